// Depth of the reference frames: from files, or from a prior on the road.
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "options.hpp"
#include "pictures.hpp"
#include "xcalib/stream/frames.hpp"

namespace xcalib::cli {

inline const std::vector<std::string> kDepthSuffixes = {".png", ".npy", ".tif", ".tiff", ".exr"};

// One depth map, float32 [m], 0 where it is not positive and finite; some pixel must be known.
// `scale`: metres per count of a 16-bit PNG; .npy, .tiff and .exr are in metres.
cv::Mat read_depth(const Path& file, double scale);

DepthPointer plane_depth(const PlaneDepth& plane);

// What --depth names, for the frames `used` of the references, conditioned as asked for: steadied,
// then completed.
DepthPointer open_depth(const DepthArguments& arguments, const FrameList& references,
                        const std::vector<int>& used);

}  // namespace xcalib::cli

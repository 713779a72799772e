// Depth of the reference frames: from files, or from a prior on the road.
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "options.hpp"
#include "pictures.hpp"
#include "xcalib/stream/frames.hpp"

namespace xcalib::cli {

inline const std::vector<std::string> kDepthSuffixes = {".png", ".npy",  ".npz", ".pfm",
                                                        ".tif", ".tiff", ".exr"};

// The numbers of one depth map as they are stored, uint16 or float32.
Picture read_numbers(const Path& file);
// The same as depth, [m], 0 where unknown.
Image read_depth(const Path& file, const DepthUnits& units);

DepthPointer plane_depth(const PlaneDepth& plane);
DepthPointer constant_depth(double metres);

// What --depth names, for the frames `used` of the references, conditioned as asked for: steadied,
// then completed.
DepthPointer open_depth(const DepthArguments& arguments, const FrameList& references,
                        const std::vector<int>& used);

}  // namespace xcalib::cli

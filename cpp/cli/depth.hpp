// Depth of the reference frames: from files, or from a prior on the road.
#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "options.hpp"
#include "pictures.hpp"
#include "xcalib/pairing.hpp"

namespace xcalib::cli {

inline const std::vector<std::string> kDepthSuffixes = {".png", ".npy", ".tif", ".tiff", ".exr"};

// One depth map, float32 [m], 0 where it is not positive and finite; some pixel must be known.
// `scale`: metres per count of a 16-bit PNG; .npy, .tiff and .exr are in metres.
cv::Mat read_depth(const Path& file, double scale);

// Depth of frame `index`, whose reference image is given.
class Depth {
   public:
    virtual ~Depth() = default;
    virtual cv::Mat operator()(int index, const cv::Mat& reference) const = 0;
};

using DepthPointer = std::shared_ptr<const Depth>;

DepthPointer plane_depth(const PlaneDepth& plane);

// What --depth names, for the frames `used` of the references, conditioned as asked for.
DepthPointer open_depth(const DepthArguments& arguments, const FrameList& references,
                        const std::vector<int>& used);

}  // namespace xcalib::cli

// Depth-guided reprojection, Eq. (3d_mapping): where each reference pixel lies in the source image,
// and the source on the reference grid.
#pragma once

#include <cstdint>
#include <vector>

#include "xcalib/camera.hpp"
#include "xcalib/export.hpp"
#include "xcalib/image.hpp"

namespace XCALIB_EXPORT xcalib {

// What a registered pixel is worth: the codes of every mask that leaves this library.
enum class Validity : std::uint8_t { valid = 0, outside = 1, occluded = 2, no_depth = 3 };

// A source image on the reference grid. `validity` holds Validity codes, one per pixel.
struct WarpedImage {
    Image image;
    std::vector<std::uint8_t> validity;
};
WarpedImage warp(const Rig& rig, const Image& source, const Image& depth);

}  // namespace xcalib

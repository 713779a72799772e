// Depth-guided reprojection, Eq. (3d_mapping): where each reference pixel lies in the source image,
// and the source on the reference grid.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstdint>
#include <type_traits>
#include <utility>

#include "xcalib/camera.hpp"
#include "xcalib/export.hpp"
#include "xcalib/image.hpp"

namespace XCALIB_EXPORT xcalib {

// What a registered pixel is worth: the codes of every mask that leaves this library.
enum class Validity : std::uint8_t { valid = 0, outside = 1, occluded = 2, no_depth = 3 };

// Eq. (3d_wrapper) times the depth: x_S = pi(D h x~ + k).
struct Reprojection {
    Eigen::Matrix3d h;  // infinite homography
    Eigen::Vector3d k;  // K_S t
    int source_width = 0;
    int source_height = 0;

    explicit Reprojection(const Rig& rig);
};

// A point nearer to the source camera's plane than this has no stable projection. [m]
inline constexpr double kNearestZ = 1e-3;

// So far beyond the outermost pixel centres a point still counts as on them: a pixel on the rim
// stays there whatever the last bit of a rounding says. [px]
inline constexpr float kRim = 1e-3f;

// One row: source coordinates [px] of the reference pixels (0..width-1, y), and their validity.
// Coordinates of pixels that are not valid are NaN.
void map_row(const Reprojection& reprojection, const float* depth, int y, int width, float* u,
             float* v, std::uint8_t* validity);

// A source image on the reference grid. `validity` holds Validity codes, one per pixel.
struct WarpedImage {
    Image image;
    std::vector<std::uint8_t> validity;
};
WarpedImage warp(const Rig& rig, const Image& source, const Image& depth);

}  // namespace xcalib

// Eq. (3d_mapping) for a row of pixels. In a header, so that it is compiled for the instruction set
// of whoever calls it.
#pragma once

#include <algorithm>
#include <limits>

#include "xcalib/warp.hpp"

namespace xcalib {

// `validity` receives Validity codes. Coordinates of pixels that are not valid are NaN.
[[gnu::always_inline]] inline void map_row_inline(const Reprojection& reprojection,
                                                  const float* depth, int y, int width, float* u,
                                                  float* v, std::uint8_t* validity) {
    // Incremental in x would drift over a row in float: the row's constant is taken in double and
    // x * step stays below one rounding of a source coordinate.
    const Eigen::Matrix3d& h = reprojection.h;
    const float ax = static_cast<float>(h(0, 0)), bx = static_cast<float>(h(0, 1) * y + h(0, 2));
    const float ay = static_cast<float>(h(1, 0)), by = static_cast<float>(h(1, 1) * y + h(1, 2));
    const float az = static_cast<float>(h(2, 0)), bz = static_cast<float>(h(2, 1) * y + h(2, 2));
    const float kx = static_cast<float>(reprojection.k.x());
    const float ky = static_cast<float>(reprojection.k.y());
    const float kz = static_cast<float>(reprojection.k.z());
    const float right = static_cast<float>(reprojection.source_width - 1);
    const float bottom = static_cast<float>(reprojection.source_height - 1);
    constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
    constexpr float kMaxDepth = std::numeric_limits<float>::max();
    for (int x = 0; x < width; ++x) {
        const float fx = static_cast<float>(x), d = depth[x];
        const float z = d * (az * fx + bz) + kz;
        const float inverse = 1.0f / z;
        const float su = (d * (ax * fx + bx) + kx) * inverse;
        const float sv = (d * (ay * fx + by) + ky) * inverse;
        const bool has_depth = (d > 0.0f) & (d <= kMaxDepth);  // false for NaN and inf
        const bool inside = (z > static_cast<float>(kNearestZ)) & (su >= -kRim) &
                            (su <= right + kRim) & (sv >= -kRim) & (sv <= bottom + kRim);
        const bool ok = has_depth & inside;
        u[x] = ok ? std::min(std::max(su, 0.0f), right) : kNaN;
        v[x] = ok ? std::min(std::max(sv, 0.0f), bottom) : kNaN;
        validity[x] = static_cast<std::uint8_t>(!has_depth ? Validity::no_depth
                                                : inside   ? Validity::valid
                                                           : Validity::outside);
    }
}

}  // namespace xcalib

#include "xcalib/warp.hpp"

#include <algorithm>
#include <limits>

#include "bilinear.hpp"

namespace xcalib {

Reprojection::Reprojection(const Rig& rig)
    : h(infinite_homography(rig)), k(rig.source.K() * rig.t()), source_width(rig.source.width),
      source_height(rig.source.height) {}

void map_row(const Reprojection& reprojection, const float* depth, int y, int width, float* u,
             float* v, std::uint8_t* validity) {
    // Incremental in x would drift over a row in float: the row's constant is taken in double and
    // x * step stays below one rounding of a source coordinate.
    const Eigen::Vector3d start = reprojection.h * Eigen::Vector3d(0, y, 1);
    const float ax = static_cast<float>(reprojection.h(0, 0)), bx = static_cast<float>(start.x());
    const float ay = static_cast<float>(reprojection.h(1, 0)), by = static_cast<float>(start.y());
    const float az = static_cast<float>(reprojection.h(2, 0)), bz = static_cast<float>(start.z());
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
        const bool has_depth = d > 0.0f && d <= kMaxDepth;  // false for NaN and inf
        // A pixel on the rim stays there whatever the last bit of a rounding says.
        constexpr float kRim = 1e-3f;
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

Eigen::Matrix<double, 2, kNumParameters> warp_jacobian(const Rig& rig, double x, double y,
                                                       double depth) {
    const Eigen::Vector3d ray = unproject(rig.reference, x, y, 1.0);
    const ProjectionDerivative derivative(rig);
    Eigen::Matrix<double, 2, kNumParameters> jacobian;
    float column[kNumParameters];
    for (int i = 0; i < 2; ++i) {
        derivative.chain<kNumParameters>(static_cast<float>(ray.x()), static_cast<float>(ray.y()),
                                         static_cast<float>(depth), i == 0, i == 1, column, 1);
        for (int p = 0; p < kNumParameters; ++p) jacobian(i, p) = column[p];
    }
    return jacobian;
}

WarpedImage warp(const Rig& rig, const Image& source, const Image& depth) {
    const Reprojection reprojection(rig);
    WarpedImage out{Image(depth.width, depth.height), {}};
    out.validity.resize(depth.pixels.size());
    std::vector<float> u(depth.width), v(depth.width);
    for (int y = 0; y < depth.height; ++y) {
        std::uint8_t* validity = out.validity.data() + static_cast<std::size_t>(y) * depth.width;
        map_row(reprojection, depth.row(y), y, depth.width, u.data(), v.data(), validity);
        for (int x = 0; x < depth.width; ++x)
            if (validity[x] == static_cast<std::uint8_t>(Validity::valid))
                out.image.row(y)[x] = bilinear(source, u[x], v[x]).value;
    }
    return out;
}

}  // namespace xcalib

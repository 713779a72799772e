#include "xcalib/warp.hpp"

#include "bilinear.hpp"
#include "map_row.hpp"

namespace xcalib {

Reprojection::Reprojection(const Rig& rig)
    : h(infinite_homography(rig)), k(rig.source.K() * rig.t()), source_width(rig.source.width),
      source_height(rig.source.height) {}

void map_row(const Reprojection& reprojection, const float* depth, int y, int width, float* u,
             float* v, std::uint8_t* validity) {
    map_row_inline(reprojection, depth, y, width, u, v, validity);
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

#include "xcalib/warp.hpp"

#include "geometry/map_row.hpp"
#include "images/bilinear.hpp"

namespace xcalib {

Reprojection::Reprojection(const Rig& rig)
    : h(infinite_homography(rig)), k(rig.source.K() * rig.t()), source_width(rig.source.width),
      source_height(rig.source.height) {}

void map_row(const Reprojection& reprojection, const float* depth, int y, int width, float* u,
             float* v, std::uint8_t* validity) {
    map_row_inline(reprojection, depth, y, width, u, v, validity);
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

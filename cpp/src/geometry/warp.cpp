#include "xcalib/warp.hpp"

#include "geometry/projector.hpp"
#include "images/bilinear.hpp"

namespace xcalib {

WarpedImage warp(const Rig& rig, const Image& source, const Image& depth) {
    const Projector projector(rig);
    WarpedImage out{Image(depth.width, depth.height), {}};
    out.validity.resize(depth.pixels.size());
    std::vector<float> u(depth.width), v(depth.width);
    for (int y = 0; y < depth.height; ++y) {
        std::uint8_t* validity = out.validity.data() + static_cast<std::size_t>(y) * depth.width;
        map_row(projector, depth.row(y), y, depth.width, u.data(), v.data(), validity);
        for (int x = 0; x < depth.width; ++x)
            if (validity[x] == static_cast<std::uint8_t>(Validity::valid))
                out.image.row(y)[x] = bilinear(source, u[x], v[x]).value;
    }
    return out;
}

}  // namespace xcalib

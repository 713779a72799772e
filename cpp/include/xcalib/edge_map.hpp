// Edges that may be averaged. Gradients of a reduced image are not those of its edges: of two
// modalities the fine edges coincide and the coarse shades do not. So edges are found at full size,
// drawn with the doubled angle, z = a exp(2 i theta), in which opposite directions are one and
// polarity drops out, and z is reduced in place of the image. Re conj(z_R) z_S = a b cos 2d is
// Eq. (nec) with 2 cos^2 d - 1 in place of |cos d|: zero on average where edges meet by chance.
#pragma once

#include <algorithm>
#include <complex>
#include <vector>

#include "xcalib/image.hpp"

namespace xcalib {

struct EdgeMap {
    int width = 0;
    int height = 0;
    std::vector<std::complex<float>> z;

    const std::complex<float>* row(int y) const {
        return z.data() + static_cast<std::size_t>(y) * width;
    }
};

// At the image's own size, halved until it is at most kEdgeMapWidth wide: nothing that reads it
// needs more.
inline constexpr int kEdgeMapWidth = 400;  // [px]
EdgeMap edge_map(const Image& image);

// Averaged over the area of each new pixel (a side that would grow is left as it is), less the mean
// of some pixels around: what all edges of a region have in common does not tell where it lies.
EdgeMap reduced(const EdgeMap& edges, int width, int height);

// Value and derivatives of the bilinear interpolant, 0 <= u <= width - 1, 0 <= v <= height - 1.
struct EdgeSample {
    std::complex<float> value, du, dv;
};
inline EdgeSample sample(const EdgeMap& map, float u, float v) {
    // The last cell serves its far edge too, so that all four pixels exist.
    const int x = std::min(static_cast<int>(u), map.width - 2);
    const int y = std::min(static_cast<int>(v), map.height - 2);
    const float a = u - static_cast<float>(x), b = v - static_cast<float>(y);
    const std::complex<float>* top = map.row(y) + x;
    const std::complex<float>* bottom = top + map.width;
    const std::complex<float> top_step = top[1] - top[0], bottom_step = bottom[1] - bottom[0];
    const std::complex<float> upper = top[0] + a * top_step, lower = bottom[0] + a * bottom_step;
    return {upper + b * (lower - upper), top_step + b * (bottom_step - top_step), lower - upper};
}

// std::complex's own product also looks for infinities.
inline std::complex<float> product(std::complex<float> a, std::complex<float> b) {
    return {a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real()};
}

}  // namespace xcalib

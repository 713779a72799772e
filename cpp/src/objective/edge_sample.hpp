// Edge maps between their pixels.
#pragma once

#include <complex>

#include "images/bilinear.hpp"
#include "xcalib/edge_map.hpp"

namespace xcalib {

inline Sample<std::complex<float>> bilinear(const EdgeMap& map, float u, float v) {
    return bilinear(map.z.data(), map.width, map.height, u, v);
}

// std::complex's own product also looks for infinities.
inline std::complex<float> product(std::complex<float> a, std::complex<float> b) {
    return {a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real()};
}

}  // namespace xcalib

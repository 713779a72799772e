// Bilinear sampling, and the exact derivative of the interpolant.
#pragma once

#include <algorithm>

#include "xcalib/image.hpp"

namespace xcalib {

template <class T>
struct Sample {
    T value, du, dv;
};

// Interpolates width x height values, both at least 2, at (u, v) within [0, width - 1] x
// [0, height - 1].
template <class T>
Sample<T> bilinear(const T* values, int width, int height, float u, float v) {
    // The last cell serves its far edge too, so that all four values exist.
    const int x = std::min(static_cast<int>(u), width - 2);
    const int y = std::min(static_cast<int>(v), height - 2);
    const float a = u - static_cast<float>(x), b = v - static_cast<float>(y);
    const T* top = values + static_cast<std::size_t>(y) * width + x;
    const T* bottom = top + width;
    const T top_step = top[1] - top[0], bottom_step = bottom[1] - bottom[0];
    const T upper = top[0] + a * top_step, lower = bottom[0] + a * bottom_step;
    return {upper + b * (lower - upper), top_step + b * (bottom_step - top_step), lower - upper};
}

inline Sample<float> bilinear(const Image& image, float u, float v) {
    return bilinear(image.pixels.data(), image.width, image.height, u, v);
}

}  // namespace xcalib

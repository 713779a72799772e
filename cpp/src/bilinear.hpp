// Bilinear sampling of a gray image, and the exact derivative of the interpolant.
#pragma once

#include <algorithm>

#include "xcalib/image.hpp"

namespace xcalib {

struct Sample {
    float value;
    float du;
    float dv;
};

// (u, v) within [0, width - 1] x [0, height - 1]; both sides at least 2.
inline Sample bilinear(const Image& image, float u, float v) {
    // The last cell serves its far edge too, so that all four pixels exist.
    const int x = std::min(static_cast<int>(u), image.width - 2);
    const int y = std::min(static_cast<int>(v), image.height - 2);
    const float a = u - static_cast<float>(x), b = v - static_cast<float>(y);
    const float* top = image.row(y) + x;
    const float* bottom = top + image.width;
    const float top_step = top[1] - top[0], bottom_step = bottom[1] - bottom[0];
    const float upper = top[0] + a * top_step, lower = bottom[0] + a * bottom_step;
    return {upper + b * (lower - upper), top_step + b * (bottom_step - top_step), lower - upper};
}

}  // namespace xcalib

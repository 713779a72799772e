// Vectors of pixels as the views that the library takes.
#pragma once

#include <limits>
#include <vector>

#include "xcalib/image.hpp"

namespace xcalib::testing {

inline constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
inline constexpr float kInfinity = std::numeric_limits<float>::infinity();

struct Size {
    int width, height;
};

template <class T>
inline constexpr PixelType kType = PixelType::u8;
template <>
inline constexpr PixelType kType<std::uint16_t> = PixelType::u16;
template <>
inline constexpr PixelType kType<float> = PixelType::f32;

template <class T>
ImageView view_of(const std::vector<T>& pixels, int width, int height, int channels = 1,
                  int values_per_row = 0) {
    const int row = values_per_row ? values_per_row : width * channels;
    return {pixels.data(), width,    height,
            channels,      kType<T>, static_cast<std::ptrdiff_t>(row * sizeof(T))};
}

}  // namespace xcalib::testing

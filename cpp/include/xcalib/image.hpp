// Images: views on the caller's pixels, one-channel images, and depth maps on other grids.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "xcalib/export.hpp"

namespace XCALIB_EXPORT xcalib {

enum class PixelType : std::uint8_t { u8, u16, f32 };

std::size_t bytes_per_channel(PixelType type);

// The caller's pixels, not owned. Colour is interleaved, in OpenCV's order (B, G, R).
struct ImageView {
    const void* data = nullptr;
    int width = 0;
    int height = 0;
    int channels = 1;  // 1 or 3
    PixelType type = PixelType::u8;
    std::ptrdiff_t row_bytes = 0;

    // T must be the type's.
    template <class T>
    const T* row(int y) const {
        return reinterpret_cast<const T*>(static_cast<const char*>(data) + y * row_bytes);
    }
};

struct MutableImageView {
    void* data = nullptr;
    int width = 0;
    int height = 0;
    int channels = 1;
    PixelType type = PixelType::u8;
    std::ptrdiff_t row_bytes = 0;
};

// One float32 channel, rows without gaps. Holds gray images and depth maps (0: unknown).
struct Image {
    int width = 0;
    int height = 0;
    std::vector<float> pixels;

    Image() = default;
    Image(int w, int h, float value = 0.0f)
        : width(w), height(h), pixels(static_cast<std::size_t>(w) * h, value) {}
    float* row(int y) { return pixels.data() + static_cast<std::size_t>(y) * width; }
    const float* row(int y) const { return pixels.data() + static_cast<std::size_t>(y) * width; }
    ImageView view() const {
        return {pixels.data(),  width,
                height,         1,
                PixelType::f32, static_cast<std::ptrdiff_t>(width * sizeof(float))};
    }
};

// A copy in which everything that is not a depth (0, negative, NaN, inf) is 0.
Image clean_depth(const ImageView& depth);

// Depth on a grid of another size. Inverse depth is averaged (reducing) or interpolated (growing)
// over known pixels that lie on one surface; across a depth edge the nearest pixel is taken, since
// a mean would put a surface where there is none. Unknown stays unknown.
Image resize_depth(const Image& depth, int width, int height);

// Throws std::invalid_argument unless the two sizes have one aspect, to within a pixel of either.
void require_same_aspect(const char* name, int width, int height, int expected_width,
                         int expected_height);

}  // namespace xcalib

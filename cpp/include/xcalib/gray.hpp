// Gray working images: from the caller's pixels to what edges are taken of.
#pragma once

#include "xcalib/export.hpp"
#include "xcalib/image.hpp"

namespace XCALIB_EXPORT xcalib {

// Luma in [0, 1] for integers (of the type's full range), as it is for float32.
// Throws std::invalid_argument, with the place, where a float32 pixel is not finite.
Image to_gray(const ImageView& image);

// The same, with pixels that are not finite filled from those around them, so that they have no
// edges of their own. Throws std::invalid_argument where they are more than half of the image.
Image known_gray(const ImageView& image);

// Mean over the area that each new pixel covers; bilinear where a side grows.
Image resize_area(const Image& image, int width, int height);

Image gaussian_blur(const Image& image, double sigma_px);

// Stretches the 1st to 99th percentile to [0, 1] (beyond is clipped): thermal images, raw 16-bit
// counts above all, use a small part of their range.
// Throws std::invalid_argument where the image is constant.
Image normalize_percentiles(const Image& image);

// The same, then log(1 + k x) / log(1 + k) with the k that takes the median to 0.4 (none where it
// lies above already, at most 100): night images keep their detail in the lowest few per cent of
// the range.
Image normalize_dark(const Image& image);

}  // namespace xcalib

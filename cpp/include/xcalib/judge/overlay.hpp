// Images for the eye.
#pragma once

#include <cstdint>
#include <vector>

#include "xcalib/export.hpp"
#include "xcalib/image.hpp"

namespace XCALIB_EXPORT xcalib {

// Gray, width * height bytes: 1 to 99 % of the non-zero finite pixels stretched to 0 to 255.
std::vector<std::uint8_t> display_gray(const ImageView& image);

// Red-cyan composite of two images of one size, blue, green, red: the reference red, the other
// cyan; where `valid` (one byte a pixel, or null) is 0, the reference alone, in gray.
// Throws std::invalid_argument where the sizes differ.
std::vector<std::uint8_t> overlay(const ImageView& reference, const ImageView& registered,
                                  const std::uint8_t* valid);

}  // namespace xcalib

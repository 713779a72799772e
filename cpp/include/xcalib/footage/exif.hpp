// How an image file says that its picture is to be turned for people to see it upright.
//
// A camera's geometry is that of its sensor: pixels are taken as they are stored, unless the user
// asks for the turn.
#pragma once

#include <string>
#include <string_view>

#include "xcalib/export.hpp"

namespace XCALIB_EXPORT xcalib {

// 1 to 8 as EXIF has it, of the bytes of a JPEG, PNG or TIFF file; 1, as stored, where it is not
// said.
int exif_orientation(std::string_view file);

// What it means, in words: `is to be turned by 90 deg clockwise`.
std::string orientation_text(int orientation);

// The bytes of a TIFF file as if it said nothing: OpenCV would turn its picture, which it does to
// no other. Other files stay as they are.
void forget_tiff_orientation(std::string& file);

}  // namespace xcalib

// What a TIFF says of its pixels, for where a decoder says nothing.
#pragma once

#include <string>
#include <string_view>

#include "xcalib/export.hpp"

namespace XCALIB_EXPORT xcalib {

// The type of the pixels of the first page, as numpy calls it (uint32); empty where that cannot be
// read from the data.
std::string tiff_pixel_type(std::string_view data);

}  // namespace xcalib

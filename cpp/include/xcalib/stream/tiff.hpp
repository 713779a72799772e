// What a TIFF says of its pixels, for where a decoder says nothing.
#pragma once

#include <string>
#include <string_view>

#include "xcalib/export.hpp"

namespace XCALIB_EXPORT xcalib {

// The type of the pixels of the first page, as numpy calls it (uint32); empty where that cannot be
// read from the data.
std::string tiff_pixel_type(std::string_view data);

// Says of the unsigned 32-bit pixels of a file's first page that they are signed, as decoders want
// them; false where it has none.
bool put_as_signed(std::string& data);

// Makes the page of full size the first of a TIFF file, as of one that begins with a thumbnail;
// other files stay as they are. Throws InputError, naming `name`, where several pages are of that
// size.
void put_full_page_first(std::string& data, const std::string& name);

}  // namespace xcalib

// The size of an image file by its header, where nobody looks at its pixels.
#pragma once

#include <filesystem>
#include <optional>

#include "xcalib/export.hpp"

namespace XCALIB_EXPORT xcalib {

struct HeaderSize {
    int width = 0, height = 0;
};

// Of a PNG or a JPEG as it is stored. None of others, and where the header is not whole: they have
// to be decoded to know.
std::optional<HeaderSize> header_size(const std::filesystem::path& file);

}  // namespace xcalib

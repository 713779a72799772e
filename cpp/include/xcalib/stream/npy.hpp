// numpy's file format, as far as images and depth maps need it.
#pragma once

#include <filesystem>
#include <string>

#include "xcalib/export.hpp"
#include "xcalib/stream/picture.hpp"

namespace XCALIB_EXPORT xcalib {

enum class ArrayKind {
    depth,  // (h, w) or (h, w, 1) of uint16, or float16, float32 or float64 as float32
    image,  // the same, of uint8 too, and (h, w, 3)
};

// An array of a kind. Throws DecodeError where it is no array, InputError where it is another one.
Picture read_npy(const std::filesystem::path& file, ArrayKind kind = ArrayKind::depth);

// The same of what is in a file that messages call `name`.
Picture parse_npy(const std::string& data, const std::string& name,
                  ArrayKind kind = ArrayKind::depth);

}  // namespace xcalib

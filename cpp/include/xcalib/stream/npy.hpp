// numpy's file format, as far as depth maps need it.
#pragma once

#include <filesystem>
#include <string>

#include "xcalib/export.hpp"
#include "xcalib/stream/picture.hpp"

namespace XCALIB_EXPORT xcalib {

// A (h, w) or (h, w, 1) array of float16, float32 or float64, as float32. Throws DecodeError where
// it is no array, InputError where it is another one.
Picture read_npy(const std::filesystem::path& file);

// The same of what is in a file that messages call `name`.
Picture parse_npy(const std::string& data, const std::string& name);

}  // namespace xcalib

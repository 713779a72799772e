// Files read and written as a whole.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "xcalib/export.hpp"

namespace XCALIB_EXPORT xcalib {

// Both throw std::system_error with the path.
std::string read_file(const std::filesystem::path& file);

// Appears under its name only when it is complete; its folder is made.
void write_file(const std::filesystem::path& file, std::string_view data);

}  // namespace xcalib

// Small files, read as a whole.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "xcalib/export.hpp"

namespace XCALIB_EXPORT xcalib {

// Of a text that people write, as rigs and calibrations are: what is larger is something else, and
// would keep a parser busy for minutes.
inline constexpr std::uintmax_t kMaxTextBytes = 1 << 20;
// Of tables of times, journals, reports.
inline constexpr std::uintmax_t kMaxTableBytes = std::uintmax_t{1} << 30;

// Throws std::system_error with the path where the file cannot be read, InputError where it is no
// file (a pipe would keep us waiting) or larger than `most` bytes.
std::string read_whole(const std::filesystem::path& file, std::uintmax_t most = UINTMAX_MAX);

}  // namespace xcalib

// Files read and written as a whole, and the files of a folder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "xcalib/export.hpp"

namespace XCALIB_EXPORT xcalib {

// Throws std::system_error with the path, InputError for what is no file (a pipe would keep us
// waiting), or has more bytes than `most`.
std::string read_file(const std::filesystem::path& file, std::uintmax_t most = UINTMAX_MAX);

// Appears under its name only when it is complete and on the disk; its folder is made. What stands
// there is replaced; a link is followed; a pipe or a device is written to as it is. Throws
// InputError where that cannot be, std::system_error with the path.
void write_file(const std::filesystem::path& file, std::string_view data);

// Files of a folder with one of the suffixes (any case), in natural order, at least one; hidden
// files are ignored. Throws InputError.
std::vector<std::filesystem::path> list_files(const std::filesystem::path& folder,
                                              const std::vector<std::string>& suffixes);

// .png of A.PNG: only ASCII letters change.
std::string lower_suffix(const std::filesystem::path& file);

// Throw InputError where a name, or what is in a file, is not UTF-8, as journals and reports are.
void check_name(const std::filesystem::path& name);
void check_text(const std::string& text, const std::filesystem::path& file);

}  // namespace xcalib

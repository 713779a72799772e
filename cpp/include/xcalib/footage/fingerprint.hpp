// Whether what an output was made of has changed since.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "xcalib/camera.hpp"
#include "xcalib/export.hpp"

namespace XCALIB_EXPORT xcalib {

// 16 hexadecimal digits of any data: it detects accidental changes, not intended ones.
std::string fingerprint(std::string_view data);

// The same for all numbers of a rig.
std::string fingerprint(const Rig& rig);

// A path from the root, without `.` and empty parts; `..` and links stay, as the user gave them.
std::filesystem::path absolute_path(const std::filesystem::path& path);

// Where a file is, its size, and the time of its last change; of a folder, those of all files in
// it. A path that cannot be read is itself.
std::vector<std::string> file_stamp(const std::filesystem::path& path);

}  // namespace xcalib

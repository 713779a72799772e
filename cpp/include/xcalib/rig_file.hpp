// The rig file: YAML, one reader and one writer for Python and C++.
#pragma once

#include <string>
#include <vector>

#include "xcalib/camera.hpp"
#include "xcalib/export.hpp"

namespace XCALIB_EXPORT xcalib {

// Throws std::system_error where the file cannot be read, std::invalid_argument, naming the file,
// the field, its value and what was expected, where it is not a rig. Every field is given once, and
// no other; quaternions are within 1e-3 of unit length, and made so.
Rig load_rig(const std::string& path);

// What of a rig is so unlikely that another unit or a slip may be behind it, a line each: numbers
// that no camera has, a translation of more than 10 m.
std::vector<std::string> implausible(const Rig& rig);

// The file appears whole or not at all: written beside, then renamed. Numbers are written with the
// digits that read back as the same double. Throws std::system_error where it cannot be written.
void save_rig(const Rig& rig, const std::string& path);

// The same without a file.
std::string rig_text(const Rig& rig);
Rig rig_of_text(const std::string& text);

}  // namespace xcalib

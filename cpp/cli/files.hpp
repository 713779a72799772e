// Suffixes and order of files.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "xcalib/stream/files.hpp"

namespace xcalib::cli {

using Path = std::filesystem::path;

bool has_suffix(const Path& file, const std::vector<std::string>& suffixes);

// In natural order of what they are called.
std::vector<Path> in_natural_order(std::vector<Path> files);

}  // namespace xcalib::cli

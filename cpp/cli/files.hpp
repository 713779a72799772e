// Folders: listed in natural order, and whether they can be written to.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace xcalib::cli {

using Path = std::filesystem::path;

std::string lower_suffix(const Path& file);
bool has_suffix(const Path& file, const std::vector<std::string>& suffixes);

// Files of a folder with one of the suffixes (any case), in natural order, at least one; hidden
// files are ignored. Throws InputError.
std::vector<Path> list_files(const Path& folder, const std::vector<std::string>& suffixes);

// In natural order of what they are called.
std::vector<Path> in_natural_order(std::vector<Path> files);

// Throw InputError now, before long work, if nothing can be written there. Nothing is made.
void check_folder_writable(const Path& folder);
void check_file_writable(const Path& file);

}  // namespace xcalib::cli

#include "files.hpp"

#include <algorithm>

#include "xcalib/footage/pairing.hpp"

namespace xcalib::cli {

bool has_suffix(const Path& file, const std::vector<std::string>& suffixes) {
    return std::find(suffixes.begin(), suffixes.end(), lower_suffix(file)) != suffixes.end();
}

std::vector<Path> in_natural_order(std::vector<Path> files) {
    std::vector<std::string> names;
    for (const Path& file : files) names.push_back(file.string());
    std::vector<Path> sorted;
    for (const int index : natural_order(names))
        sorted.push_back(std::move(files[static_cast<std::size_t>(index)]));
    return sorted;
}

}  // namespace xcalib::cli

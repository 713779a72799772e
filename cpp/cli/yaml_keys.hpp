// Small YAML files: keys and values, a line each.
#pragma once

#include <yaml-cpp/yaml.h>

#include <map>
#include <string>

namespace xcalib::cli {

// The values of a file by their keys. Throws InputError, with `names`, the keys that are expected,
// where it is no such file.
std::map<std::string, YAML::Node> read_keys(const std::string& file, const std::string& names);

}  // namespace xcalib::cli

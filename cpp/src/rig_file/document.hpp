// A YAML document that is safe to look at: one, of bounded size and depth, with no key twice.
#pragma once

#include <yaml-cpp/yaml.h>

#include <string>

namespace xcalib {

// Throws std::system_error where the file cannot be read, std::invalid_argument naming it where it
// is no such document.
YAML::Node load_document(const std::string& path);

// The same of a text that messages call `path`.
YAML::Node parse_document(const std::string& text, const std::string& path);

// A value as messages quote it: in one line, and not more of it than one can read.
std::string quoted(const std::string& value);

}  // namespace xcalib

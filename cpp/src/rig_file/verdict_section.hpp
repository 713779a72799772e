// What a rig file says of the calibration that the rig is of.
#pragma once

#include <yaml-cpp/yaml.h>

#include <ostream>
#include <string>

#include "xcalib/verdict.hpp"

namespace xcalib {

// Throws std::invalid_argument with `path`, and the field that is wrong.
Verdict read_verdict(const std::string& path, const YAML::Node& node);
void write_verdict(std::ostream& out, const Verdict& verdict);

}  // namespace xcalib

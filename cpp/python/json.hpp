// JSON values as Python has them.
#pragma once

#include <pybind11/pybind11.h>

#include "judge/json.hpp"

namespace xcalib {

// Dicts, lists, numbers and text; numbers that are not finite stay numbers.
pybind11::object object_of(const Json& json);

}  // namespace xcalib

// The parts of the module, each in a file of its own.
#pragma once

#include <pybind11/pybind11.h>

namespace xcalib {

void bind_footage(pybind11::module_& m);     // pairing, choice of frames, false colour, depth
void bind_evaluation(pybind11::module_& m);  // scores, facts of a rig, pictures

}  // namespace xcalib

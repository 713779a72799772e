#include "bindings.hpp"
#include "json.hpp"
#include "xcalib/judge/describe.hpp"

namespace xcalib {

namespace py = pybind11;

void bind_describe(py::module_& m) {
    m.def(
        "describe", [](const Rig& rig) { return object_of(json_of(rig)); }, py::arg("rig"),
        R"(The rig's parameters and what follows from them, in px, deg and m.

rotation_deg turns the source camera out of the reference camera's axes: pan to the right, then tilt
up, then roll clockwise. Parallax is the distance from the point at infinity.)");
    m.def("facts_text", &facts_text, py::arg("rig"), "describe(), as lines.");
}

}  // namespace xcalib

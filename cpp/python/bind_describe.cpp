#include <pybind11/stl.h>

#include "bindings.hpp"
#include "xcalib/judge/describe.hpp"

namespace xcalib {
namespace {

namespace py = pybind11;

}  // namespace

void bind_describe(py::module_& m) {
    m.def(
        "describe",
        [](const Rig& rig) {
            const RigFacts facts = describe(rig);
            py::list centre;
            for (const RigFacts::Centre& row : facts.centre)
                centre.append(py::dict(
                    py::arg("depth_m") = row.depth,
                    py::arg("point_px") = std::vector<double>{row.point.x(), row.point.y()},
                    py::arg("parallax_px") = row.parallax));
            return py::dict(py::arg("rotation_deg") = py::dict(py::arg("pan") = facts.pan_deg,
                                                               py::arg("tilt") = facts.tilt_deg,
                                                               py::arg("roll") = facts.roll_deg),
                            py::arg("position_m") =
                                std::vector<double>(facts.position.begin(), facts.position.end()),
                            py::arg("baseline_m") = facts.baseline, py::arg("centre") = centre);
        },
        py::arg("rig"),
        R"(What follows from the rig's parameters, in px, deg and m.

rotation_deg turns the source camera out of the reference camera's axes: pan to the right, then tilt
up, then roll clockwise. Parallax is the distance from the point at infinity.)");
    m.def("facts_text", &facts_text, py::arg("rig"), "describe() and the cameras, as lines.");
}

}  // namespace xcalib

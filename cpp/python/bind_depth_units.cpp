#include "arrays.hpp"
#include "value_class.hpp"
#include "xcalib/depth/depth_units.hpp"

namespace xcalib {
namespace {

// Numbers as they are stored: not made metres of.
Held numbers_of(const std::string& where, const py::object& numbers) {
    return image_of(where + ": depth", numbers);
}

}  // namespace

void bind_depth_units(py::module_& m) {
    ValueClass<DepthUnits>(m, "DepthUnits", "What the numbers of depth maps mean.")
        .def_options()
        .def_readwrite("scale", &DepthUnits::scale,
                       "Metres per unit of the numbers, of disparities px. None: 1/256 of the "
                       "counts of a PNG, 1 of floats.")
        .def_readwrite("invalid", &DepthUnits::invalid,
                       "Numbers that mean unknown, besides those that are not above 0 or not "
                       "finite, and the largest count of 16 bits.")
        .def_readwrite("baseline", &DepthUnits::baseline,
                       "Not 0: the numbers are disparities d [px] of cameras so far apart [m], and "
                       "depth is focal * baseline / (d + doffs).")
        .def_readwrite("focal", &DepthUnits::focal, "[px]")
        .def_readwrite("doffs", &DepthUnits::doffs, "[px]")
        .def("validate", &DepthUnits::validate,
             "Raises InputError naming the field, its value and the allowed range.")
        .as_value();
    m.def("depth_unit_of", &depth_unit_of, py::arg("word"),
          "Metres per unit of what --depth-unit says: m, cm, mm or 1/N. Raises InputError.");
    m.def(
        "metres_of",
        [](const py::object& numbers, const DepthUnits& units, const std::string& where,
           bool is_png) {
            const Held held = numbers_of(where, numbers);
            return array_of(unlocked([&] { return metres_of(held.view, units, where, is_png); }));
        },
        py::arg("numbers"), py::arg("units"), py::arg("where"), py::arg("is_png"),
        R"((h, w) float32 [m] of a map's numbers, uint16 or float32; 0 where unknown.

where names the map in messages; is_png: counts without a scale are of 1/256. Raises InputError where
the unit is not known.)");
    m.def(
        "units_line",
        [](const py::object& numbers, const DepthUnits& units, const std::string& where,
           bool is_png) {
            const Held held = numbers_of(where, numbers);
            return unlocked([&] { return units_line(held.view, units, where, is_png); });
        },
        py::arg("numbers"), py::arg("units"), py::arg("where"), py::arg("is_png"),
        "A line on what a map is taken for: the range of its depth, its unit, the share that is "
        "unknown.");
    m.def("depth_choices", &depth_choices,
          "What --depth may be, a line each; for the error where it is left out.");
}

}  // namespace xcalib

#include <pybind11/stl.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "xcalib/footage/false_colour.hpp"

namespace xcalib {

void bind_false_colour(py::module_& m) {
    py::class_<ColorMap>(m, "ColorMap", "A curve in the colour cube, from cold to hot.")
        .def_readonly("name", &ColorMap::name, "Name of a known map, or `estimated`.")
        .def_property_readonly(
            "curve",
            [](const ColorMap& map) {
                return py::array_t<std::uint8_t>({256, 3}, map.curve.front().data());
            },
            "(256, 3) uint8, blue, green, red.")
        .def(
            "invert",
            [](const ColorMap& map, const py::object& image) -> py::object {
                const Held held = image_of("image", image);
                if (held.view.channels != 3) return held.array;
                return array_of(unlocked([&] { return map.invert(held.view); }), held.view.width,
                                held.view.height);
            },
            py::arg("image"),
            "The place of each pixel on the curve, 0 to 255: (h, w, 3) to (h, w) uint8. An image "
            "of one channel is returned as it is.");
    m.def("known_color_maps", &known_color_maps, "OpenCV's, and `iron`.");
    m.def(
        "recognise",
        [](const py::sequence& images) {
            const HeldList held = list_of("image", images, image_of);
            const py::gil_scoped_release released;
            return recognise(held.views);
        },
        py::arg("images"),
        R"(The ColorMap of false-colour images of one camera, or None if they are none.

The known map that is nearest, or one named `estimated`, whose bright end counts as hot. Gray
images, tinted ones, and photographs give None. A few images are enough, and more than one is better
where the map is not a known one.)");
}

}  // namespace xcalib

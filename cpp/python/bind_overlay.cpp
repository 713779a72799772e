#include "arrays.hpp"
#include "bindings.hpp"
#include "xcalib/judge/overlay.hpp"

namespace xcalib {

void bind_overlay(py::module_& m) {
    m.def(
        "display_gray",
        [](const py::object& image) {
            const Held held = image_of("image", image);
            return array_of(display_gray(held.view), held.view.width, held.view.height);
        },
        py::arg("image"),
        "Gray for the eye, (H, W) uint8: 1 to 99 % of the non-zero pixels stretched to 0 to 255.");
    m.def(
        "overlay",
        [](const py::object& reference, const py::object& registered, const py::object& codes) {
            const Held a = image_of("reference", reference), b = image_of("registered", registered);
            const HeldMask mask = mask_of(codes, a.view.width, a.view.height);
            return py::array_t<std::uint8_t>({a.view.height, a.view.width, 3},
                                             overlay(a.view, b.view, mask.data).data());
        },
        py::arg("reference"), py::arg("registered"), py::arg("mask") = py::none(),
        R"(Red-cyan composite (H, W, 3) uint8 of two images of one size: reference red, other cyan.

Where the other is not valid by its mask, (H, W) as Registrar.register() gives it, the reference
alone is shown, in gray.)");
}

}  // namespace xcalib

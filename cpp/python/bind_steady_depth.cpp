#include "arrays.hpp"
#include "bindings.hpp"
#include "xcalib/depth/steady_depth.hpp"

namespace xcalib {

void bind_steady_depth(py::module_& m) {
    py::class_<DepthSteadier>(m, "DepthSteadier",
                              R"(Depth of a video, averaged over time along the image flow; causal.

What the last frame knew is carried to this one by patch_flow() between their reference images, and
by one forward speed for the whole frame. A pixel goes on with the running mean of its inverse depth,
of 4 frames at most, or starts anew where depth or image around it has changed.)")
        .def(py::init<>())
        .def(
            "__call__",
            [](DepthSteadier& steadier, int index, const py::object& depth,
               const py::object& reference, int num_threads) {
                const Held d = depth_of("depth", depth), r = image_of("reference", reference);
                return array_of(
                    unlocked([&] { return steadier(index, d.view, r.view, num_threads); }));
            },
            py::arg("index"), py::arg("depth"), py::arg("reference"), py::arg("num_threads") = 0,
            "Frames are to follow on each other; any other one starts anew, and passes as it is. "
            "depth (h, w) float32 [m], 0 unknown, which stays unknown; reference: its image, of "
            "the same aspect. The result does not depend on num_threads.");
}

}  // namespace xcalib

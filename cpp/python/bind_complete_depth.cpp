#include "arrays.hpp"
#include "bindings.hpp"
#include "xcalib/depth/complete_depth.hpp"

namespace xcalib {

void bind_complete_depth(py::module_& m) {
    m.def(
        "completion_confidence", [] { return kCompletionConfidence; },
        "Filled pixels below it stay unknown, unless asked for.");
    m.def(
        "complete_depth",
        [](const py::object& depth, const py::object& guide) {
            const Held d = depth_of("depth", depth), g = image_of("guide", guide);
            const CompletedDepth out = unlocked([&] { return complete_depth(d.view, g.view); });
            return py::make_tuple(array_of(out.depth), array_of(out.confidence));
        },
        py::arg("depth"), py::arg("guide"),
        R"(Fills the unknown pixels of a depth map along image edges; known ones are kept.

depth (h, w) float32 [m], 0 unknown; guide: the reference image, of the same aspect. Returns
(depth, confidence), (h, w) float32 each: depth > 0 everywhere; confidence in [0, 1], 1 where depth
was known, and lower the farther a pixel is from known depth and the more depth varies around it. An
order, not a probability. Raises InputError where nothing is known or the aspects differ.)");
    m.def(
        "completed",
        [](const py::object& depth, const py::object& guide, double min_confidence) {
            const Held d = depth_of("depth", depth), g = image_of("guide", guide);
            return array_of(unlocked([&] { return completed(d.view, g.view, min_confidence); }));
        },
        py::arg("depth"), py::arg("guide"), py::arg("min_confidence") = kCompletionConfidence,
        "The depth of complete_depth() where its confidence is at least min_confidence, [0, 1]; 0 "
        "elsewhere.");
    m.def(
        "compressed_guide",
        [](const py::object& guide, int width, int height) {
            const Held g = image_of("guide", guide);
            return array_of(compressed_guide(g.view, width, height));
        },
        py::arg("guide"), py::arg("width"), py::arg("height"),
        "The guide as gray of another size, with the contrast of dark parts raised: (height, "
        "width) float32 in [0, 1].");
}

}  // namespace xcalib

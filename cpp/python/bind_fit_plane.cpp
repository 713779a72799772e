#include <pybind11/stl.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "xcalib/depth/fit_plane.hpp"

namespace xcalib {

void bind_fit_plane(py::module_& m) {
    m.def("frames_to_judge_plane", &frames_to_judge_plane, py::arg("count"),
          "Of count frames, those that judge a plane: at most a dozen, evenly spread.");
    m.def(
        "fit_plane",
        [](const py::sequence& references, const py::sequence& sources, const PlaneDepth& plane,
           const Rig& rig, const CalibrationOptions& options, const py::object& progress) {
            const HeldList r = list_of("reference", references, image_of);
            const HeldList s = list_of("source", sources, image_of);
            const auto notify = [&progress] {
                const py::gil_scoped_acquire gil;
                if (PyErr_CheckSignals() != 0) throw py::error_already_set();  // Ctrl-C
                if (!progress.is_none()) progress();
            };
            const py::gil_scoped_release released;
            return fit_plane(r.views, s.views, plane, rig, options, notify);
        },
        py::arg("references"), py::arg("sources"), py::arg("plane"), py::arg("rig"),
        py::arg("options"), py::arg("progress") = py::none(),
        R"(The PlaneDepth near plane whose best rig aligns most edges.

references, sources: images as calibrate() takes them; a dozen is enough. plane: where to start; its
height, far distance and field of view are kept, since height scales depth and translation alike.
rig: fitted with plane, where fits start. options: known cameras and threads are kept. progress: is
called after each fit.)");
}

}  // namespace xcalib

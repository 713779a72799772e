#include <pybind11/functional.h>
#include <pybind11/stl.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "xcalib/footage/choose.hpp"

namespace xcalib {

void bind_choose(py::module_& m) {
    m.def("frames_to_look_at", &frames_to_look_at, py::arg("count"), py::arg("max_frames"),
          py::arg("seed"),
          "Indices of the frames, of count, that a choice of max_frames looks at: four of each "
          "wanted, drawn with seed; rising.");
    py::class_<Candidate>(m, "Candidate", "What is kept of one frame, and what became of it.")
        .def(py::init([](int index, std::string reason) {
                 Candidate candidate;
                 candidate.index = index;
                 candidate.decoded = false;
                 candidate.reason = std::move(reason);
                 return candidate;
             }),
             py::arg("index"), py::arg("reason"), "A frame that cannot be decoded.")
        .def_readonly("index", &Candidate::index, "Index of the frame in the footage.")
        .def_readonly("decoded", &Candidate::decoded, "Whether there were images to look at.")
        .def_readonly("taken", &Candidate::taken, "Whether it is in the choice.")
        .def_readonly("reason", &Candidate::reason, "Why it was taken or left.")
        .def_readonly("agreement", &Candidate::agreement,
                      "Normalized correlation of the two images' edges where the footage as a "
                      "whole aligns; NaN where not measured.")
        .def_readonly("gain", &Candidate::gain,
                      "What it added, or at the end would have added, to the log-determinant of "
                      "the information; NaN where not measured.");
    m.def(
        "look_at",
        [](int index, const py::object& reference, const py::object& source,
           const py::object& depth) {
            const Held r = image_of("reference", reference), s = image_of("source", source);
            std::optional<Held> d;
            if (!depth.is_none()) d = depth_of("depth", depth);
            const py::gil_scoped_release released;
            return look_at(index, r.view, s.view, d ? &d->view : nullptr);
        },
        py::arg("index"), py::arg("reference"), py::arg("source"), py::arg("depth") = py::none(),
        "The Candidate of a frame; depth (h, w) float32 [m], None leaves it out of the choice.");
    py::class_<Choice>(m, "Choice",
                       "The frames to calibrate on, and what was found out on the way.")
        .def_readonly("indices", &Choice::indices, "Indices of the frames taken, rising.")
        .def_readonly("candidates", &Choice::candidates, "Every frame looked at, in order.")
        .def_property_readonly("unusable", &Choice::unusable,
                               "Candidates that something was found against: they never were in "
                               "the choice.")
        .def("__repr__",
             [](const Choice& choice) {
                 return "Choice(" + std::to_string(choice.indices.size()) + " of " +
                        std::to_string(choice.candidates.size()) + " frames looked at, " +
                        std::to_string(choice.unusable().size()) + " unusable)";
             })
        .def("table", &Choice::table, py::arg("names"),
             "One line per candidate: its name, what was measured, why it was taken or left.");
    m.def("choose", &choose, py::arg("candidates"), py::arg("max_frames"),
          py::call_guard<py::gil_scoped_release>(),
          "The Choice of at most max_frames of the candidates that determine the rig best; without "
          "a usable one it is empty.");
}

}  // namespace xcalib

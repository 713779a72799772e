#include <pybind11/functional.h>
#include <pybind11/stl.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "xcalib/footage/clock_offset.hpp"

namespace xcalib {
namespace {

using EdgesInPython = std::function<py::object(int)>;

// The edges of a frame by its index, as the core asks for them; none where Python has None.
EdgesOfFrame edges_of(const EdgesInPython& given) {
    return [&given](int index) -> std::optional<Image> {
        const py::object edges = given(index);
        if (edges.is_none()) return std::nullopt;
        const Held held = depth_of("edges", edges);
        Image out(held.view.width, held.view.height);
        const float* first = held.view.row<float>(0);
        std::copy(first, first + out.pixels.size(), out.pixels.begin());
        return out;
    };
}

OffsetEstimate estimated_offset(const std::vector<double>& references,
                                const std::vector<double>& sources,
                                const EdgesInPython& reference_edges,
                                const EdgesInPython& source_edges, double max_offset,
                                int max_frames) {
    return estimate_offset(references, sources, edges_of(reference_edges), edges_of(source_edges),
                           max_offset, max_frames);
}

void bind_estimate(py::module_& m) {
    py::class_<OffsetEstimate>(m, "OffsetEstimate", "A clock offset, and what speaks for it.")
        .def(py::init(
                 [](double offset, bool trusted, double correlation, double contrast, double peak) {
                     return OffsetEstimate{offset, trusted, correlation, contrast, peak};
                 }),
             py::arg("offset"), py::arg("trusted"), py::arg("correlation"), py::arg("contrast"),
             py::arg("peak"))
        .def_readonly("offset", &OffsetEstimate::offset,
                      "By how much the source's clock is late [s]; 0 where the footage does not "
                      "show it.")
        .def_readonly("trusted", &OffsetEstimate::trusted, "Whether it does.")
        .def_readonly("correlation", &OffsetEstimate::correlation,
                      "Height of the peak, in [-1, 1].")
        .def_readonly("contrast", &OffsetEstimate::contrast,
                      "What it stands above the best peak elsewhere.")
        .def_readonly("peak", &OffsetEstimate::peak, "Where the peak is [s], trusted or not.")
        .def("line", &OffsetEstimate::line, "In one line.");
    m.def(
        "motion_edges",
        [](const py::object& image) {
            const Held held = image_of("image", image);
            return array_of(unlocked([&] { return motion_edges(held.view); }));
        },
        py::arg("image"),
        "Magnitude of the gradient of a small gray copy, (h, 160) float32: about 1 on an edge "
        "whatever the gain. Pixels that are not finite count as black.");
    m.def("estimate_offset", &estimated_offset, py::arg("references"), py::arg("sources"),
          py::arg("reference_edges"), py::arg("source_edges"), py::arg("max_offset") = 2.0,
          py::arg("max_frames") = 1500,
          R"(A constant offset between the clocks of two streams, neither registered.

references, sources: times of their frames [s], never falling, each on its own clock.
reference_edges, source_edges: motion_edges() of frame i, None where it cannot be decoded.
max_offset: the largest looked for, either way [s]; also at most a third of the footage. max_frames:
references asked for at most, from the middle of the footage. Raises InputError where the times do
not overlap.)");
}

void bind_refine(py::module_& m) {
    py::class_<RefinedOffset>(
        m, "RefinedOffset",
        "A clock offset chosen by how well frames register, and what speaks for it.")
        .def_readonly("offset", &RefinedOffset::offset,
                      "By how much the source's clock is late [s]; the middle candidate where "
                      "it is not known.")
        .def_readonly("told", &RefinedOffset::told,
                      "Whether the frames register worse at both ends of the candidates.")
        .def_readonly("scores", &RefinedOffset::scores,
                      "Mean NEC of the frames judged, at each candidate; empty if fewer than two "
                      "can be.")
        .def("line", &RefinedOffset::line, "In one line.");
    m.def("offsets_around", &offsets_around, py::arg("guess"), py::arg("references"),
          py::arg("sources"),
          "Candidates for refine_offset(), from the times of both streams [s]: 6 frames of the "
          "faster one either way, in quarters [s].");
    py::class_<RegisteredNec>(m, "RegisteredNec",
                              "NEC of a reference and a source frame, registered.")
        .def(py::init<const Rig&>(), py::arg("rig"), "Rescaled to the frames.")
        .def(
            "__call__",
            [](RegisteredNec& judge, const py::object& reference, const py::object& source,
               const py::object& depth) {
                const Held r = image_of("reference", reference), s = image_of("source", source);
                const Held d = depth_of("depth", depth);
                return unlocked([&] { return judge(r.view, s.view, d.view); });
            },
            py::arg("reference"), py::arg("source"), py::arg("depth"),
            "In [0, 1]; 0 where no pixel is valid. Frames of one size; depth (h, w) float32 [m], 0 "
            "unknown.");
    m.def("refine_offset", &refine_offset, py::arg("references"), py::arg("sources"),
          py::arg("candidates"), py::arg("score"), py::arg("max_frames") = 12,
          R"(Chooses among candidate offsets [s], rising, around a guess in their middle.

references, sources: times of their frames [s]. score: the RegisteredNec of a reference and a source
frame, by their indices, None where one cannot be decoded. Among the candidates that differ from the
best by less than the frames do among each other (two standard errors of the mean), the one nearest
to the middle is taken. max_frames: of the slower stream, spread over the footage. Raises InputError
without candidates.)");
}

}  // namespace

void bind_clock_offset(py::module_& m) {
    bind_estimate(m);
    bind_refine(m);
}

}  // namespace xcalib

#include <pybind11/stl.h>

#include "bindings.hpp"
#include "xcalib/footage/clock_offset.hpp"

namespace xcalib {

namespace py = pybind11;

void bind_clock_offset(py::module_& m) {
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
    py::class_<RefinedOffset>(
        m, "RefinedOffset",
        "A clock offset chosen by how well frames register, and what speaks for it.")
        .def_readonly("offset", &RefinedOffset::offset,
                      "By how much the source's clock is late [s]; the middle candidate where "
                      "it is not known.")
        .def_readonly("decided", &RefinedOffset::decided,
                      "Whether the frames register worse at both ends of the candidates.")
        .def_readonly("scores", &RefinedOffset::scores,
                      "Mean NEC of the frames judged, at each candidate; empty if fewer than two "
                      "can be.")
        .def("line", &RefinedOffset::line, "In one line.");
}

}  // namespace xcalib

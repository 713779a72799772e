#include <pybind11/functional.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "xcalib/footage/pairing.hpp"

namespace xcalib {
namespace {

py::array_t<std::ptrdiff_t> indices_of(const std::vector<int>& indices) {
    py::array_t<std::ptrdiff_t> out(static_cast<py::ssize_t>(indices.size()));
    std::copy(indices.begin(), indices.end(), out.mutable_data());
    return out;
}

void bind_names_and_times(py::module_& m) {
    m.def("natural_order", &natural_order, py::arg("names"),
          "Indices of names in the order in which people count: runs of digits compare as numbers, "
          "letters of ASCII without their case.");
    m.def("pair_files", &pair_files, py::arg("first"), py::arg("second"),
          R"(The partner in second of each file of first, as indices; neither may be empty.

Files of the same stem belong together; if none is common, those with the same numbers in their
names; if none is common either, their order decides. Raises InputError, naming what has no partner,
where names agree only in part or the counts differ.)");
    m.def("times_of_names", &times_of_names, py::arg("names"),
          "Seconds where every name holds one time since 1970 (19, 16 or 13 digits, seconds with a "
          "fraction, SEC_NSEC, or a date and a time of day with a fraction) and they rise; None "
          "otherwise.");
}

void bind_pairing_classes(py::module_& m) {
    py::class_<Pairing>(m, "Pairing", "Indices into two streams, and how they were found.")
        .def_readonly("method", &Pairing::method, "name, order or time.")
        .def_property_readonly(
            "references", [](const Pairing& p) { return indices_of(p.references); },
            "(N,) indices.")
        .def_property_readonly(
            "sources", [](const Pairing& p) { return indices_of(p.sources); }, "(N,) indices.")
        .def_property_readonly(
            "dropped",
            [](const Pairing& p) { return std::pair(p.dropped_references, p.dropped_sources); },
            "Frames of either stream without a partner.")
        .def_readonly("alone", &Pairing::alone,
                      "Files without a partner, by name, a few of them; '' where there are none.")
        .def_readonly("gap", &Pairing::gap, "Median distance in time, the offset allowed for [s].")
        .def_readonly("offset", &Pairing::offset, "By how much the source's clock is late [s].")
        .def_readonly("lag", &Pairing::lag,
                      "By how many of its frames the source is late beyond that.")
        .def("line", &Pairing::line, "What happened, in one line.");
}

}  // namespace

void bind_pairing(py::module_& m) {
    bind_names_and_times(m);
    bind_pairing_classes(m);
    m.def("pair_times", &pair_times, py::arg("references"), py::arg("sources"),
          py::arg("offset") = 0.0, py::arg("max_gap") = py::none(),
          R"(Pairs nearest times, one to one and in order, at most max_gap apart [s].

The frames of the stream with fewer of them choose, one after the other, among the frames behind the
last one chosen. By default max_gap is half the larger median period. Raises InputError where no two
are near.)");
}

}  // namespace xcalib

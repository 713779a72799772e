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
          "Seconds where every name holds one time since 1970 (19, 16 or 13 digits, or seconds "
          "with a fraction) and they rise; None otherwise.");
    m.def("times_of_table", &times_of_table, py::arg("text"), py::arg("table"), py::arg("names"),
          R"(Seconds of each name, from the text of a table of `name timestamp` lines.

Names with or without suffix, then a comma, semicolon or blanks; lines of other kinds may only come
first, # comments anywhere. Times of 19, 16 or 13 digits are nano-, micro- and milliseconds, others
seconds. Raises InputError that begins with table, the file's name.)");
    m.def("median_period", &median_period, py::arg("times"),
          "Median distance of times [s]; 0 for a single one.");
}

void bind_pairing_classes(py::module_& m) {
    py::class_<FrameList>(m, "FrameList", "The frames of a camera, without their pixels.")
        .def(py::init([](std::vector<std::string> names, std::vector<std::string> where,
                         std::vector<std::filesystem::path> paths,
                         std::optional<std::vector<double>> times) {
                 return FrameList{std::move(names), std::move(paths), std::move(times),
                                  std::move(where)};
             }),
             py::arg("names"), py::arg("where"),
             py::arg("paths") = std::vector<std::filesystem::path>{}, py::arg("times") = py::none(),
             "names: without suffix; where: for messages; paths: of image files, none for other "
             "frames; times: seconds, never falling, or None.");

    py::class_<Pairing>(m, "Pairing", "Indices into two streams, and how they were found.")
        .def(
            py::init([](std::string method, std::vector<int> references, std::vector<int> sources) {
                Pairing pairing;
                pairing.method = std::move(method);
                pairing.references = std::move(references);
                pairing.sources = std::move(sources);
                return pairing;
            }),
            py::arg("method"), py::arg("references"), py::arg("sources"))
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
        .def_readonly("gap", &Pairing::gap, "Median distance in time, the offset allowed for [s].")
        .def_readonly("offset", &Pairing::offset, "By how much the source's clock is late [s].")
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
    m.def("pair_frames", &pair_frames, py::arg("references"), py::arg("sources"),
          py::arg("method") = "auto", py::arg("offset") = 0.0, py::arg("max_gap") = py::none(),
          R"(Pairs two FrameLists.

method: name (pair_files), order (first with first, of equally many), time (pair_times), or auto: by
time where both have times, else files by name, and others in order. offset [s]: reference time t is
source time t + offset; not 0: by time. Raises InputError.)");
    m.def("match_depths", &match_depths, py::arg("references"), py::arg("used"), py::arg("depths"),
          R"(The depth map, as an index into depths, of each of the references used.

Files under the names of the frames are theirs, and others are left over. Else the nearest in time
within half a period of the references, where both have times; else by pair_files, of all references or
of those in use. Raises InputError.)");
    m.def("nearest_depths", &nearest_depths, py::arg("references"), py::arg("used"),
          py::arg("depths"), py::arg("where"),
          "The nearest depth map in time, as match_depths() does it; depths: their times [s].");
}

}  // namespace xcalib

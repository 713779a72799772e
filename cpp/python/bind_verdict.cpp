#include "bindings.hpp"
#include "xcalib/verdict.hpp"

namespace xcalib {

namespace py = pybind11;

void bind_verdict(py::module_& m) {
    py::class_<ExpectedError>(
        m, "ExpectedError",
        "How far the registered source is expected to lie from where it belongs [px of the\n"
        "reference when its width is 640 px].")
        .def_readonly("median", &ExpectedError::median, "Half of the pixels are no farther off.")
        .def_readonly("p95", &ExpectedError::p95, "95 % of the pixels are no farther off.")
        .def("__iter__",
             [](const ExpectedError& error) {
                 return py::iter(py::make_tuple(error.median, error.p95));
             })
        .def("__repr__", [](const ExpectedError& error) {
            return "ExpectedError(median=" + std::string(py::str(py::float_(error.median))) +
                   ", p95=" + std::string(py::str(py::float_(error.p95))) + ")";
        });
    py::class_<Verdict, std::shared_ptr<Verdict>>(
        m, "Verdict", "Is a calibration to be trusted, and how far off is it?")
        .def_readonly("trusted", &Verdict::trusted,
                      "Found, plausible, and the expected error within the tolerance.")
        .def_readonly("found", &Verdict::found, "Two calibrations that share no frame agree.")
        .def_readonly("reason", &Verdict::reason, "Why it is, or is not, to be trusted.")
        .def_readonly("advice", &Verdict::advice, "What to do next; empty where it is trusted.")
        .def_readonly("expected_error", &Verdict::expected_error,
                      "ExpectedError over the depths that the footage has.")
        .def_property_readonly(
            "by_depth",
            [](const Verdict& verdict) {
                py::dict table;
                for (const ErrorAtDepth& row : verdict.by_depth)
                    table[py::float_(row.depth)] = row.error;
                return table;
            },
            "ExpectedError by depth [m], nearest first; empty for relative depth.")
        .def_readonly("frames", &Verdict::frames, "Number of pairs that it rests on.")
        .def_readonly("date", &Verdict::date, "Of the calibration, YYYY-MM-DD (UTC).")
        .def_readonly("software", &Verdict::software, "That made it, and its version.")
        .def("line", &Verdict::line, "Reason and advice.")
        .def("error_at", &Verdict::error_at, py::arg("depth"),
             "ExpectedError at a depth [m], in proportion to inverse depth between those of\n"
             "by_depth; NaN where there is none, or the depth is not positive.")
        .def(py::pickle(
            [](const Verdict& v) {
                py::list rows;
                for (const ErrorAtDepth& row : v.by_depth)
                    rows.append(py::make_tuple(row.depth, row.error.median, row.error.p95));
                return py::make_tuple(v.trusted, v.found, v.reason, v.advice,
                                      v.expected_error.median, v.expected_error.p95, rows, v.frames,
                                      v.date, v.software);
            },
            [](const py::tuple& s) {
                Verdict v;
                v.trusted = s[0].cast<bool>();
                v.found = s[1].cast<bool>();
                v.reason = s[2].cast<std::string>();
                v.advice = s[3].cast<std::string>();
                v.expected_error = {s[4].cast<double>(), s[5].cast<double>()};
                for (const py::handle row : s[6])
                    v.by_depth.push_back(
                        {row[py::int_(0)].cast<double>(),
                         {row[py::int_(1)].cast<double>(), row[py::int_(2)].cast<double>()}});
                v.frames = s[7].cast<int>();
                v.date = s[8].cast<std::string>();
                v.software = s[9].cast<std::string>();
                return v;
            }));
}

}  // namespace xcalib

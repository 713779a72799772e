#include <pybind11/stl.h>

#include "bindings.hpp"
#include "xcalib/footage/sequence.hpp"
#include "xcalib/stream/stream.hpp"

namespace xcalib {

namespace py = pybind11;

void bind_sequence(py::module_& m) {
    py::class_<TimeOffset>(m, "TimeOffset", "What --time-offset says.")
        .def_readonly("automatic", &TimeOffset::automatic, "To be found from the footage.")
        .def_readonly("seconds", &TimeOffset::seconds, "By which the source's clock is late.")
        .def_readonly("frames", &TimeOffset::frames,
                      "By how many of its frames the source is late beyond that.")
        .def(
            "__str__",
            [](const TimeOffset& offset) {
                if (offset.automatic) return std::string("auto");
                if (offset.frames != 0) return std::to_string(offset.frames) + "f";
                return py::str(py::float_(offset.seconds)).cast<std::string>();
            },
            "As the option has it.");
    m.def("parse_time_offset", &parse_time_offset, py::arg("text"),
          "`auto`, seconds (0.1), or source frames (2f). Raises InputError.");
    m.def(
        "is_sequence", [](const Stream& stream) { return clock_of(stream.frames()).has_value(); },
        py::arg("stream"), py::call_guard<py::gil_scoped_release>(),
        "Whether frames follow each other: their times are at most a second apart, or one number "
        "in "
        "their names rises, by one as a rule.");
}

}  // namespace xcalib

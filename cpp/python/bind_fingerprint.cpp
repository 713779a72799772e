#include <pybind11/stl/filesystem.h>

#include "bindings.hpp"
#include "xcalib/footage/fingerprint.hpp"

namespace xcalib {
namespace {

namespace py = pybind11;

}  // namespace

void bind_fingerprint(py::module_& m) {
    m.def(
        "fingerprint", [](const std::string& data) { return fingerprint(data); }, py::arg("data"),
        "16 hexadecimal digits of a text, or of bytes: it detects accidental "
        "changes, not intended ones.");
    m.def("absolute_path", &absolute_path, py::arg("path"),
          "A path from the root, without `.` and empty parts; `..` and links stay.");
}

}  // namespace xcalib

#include <pybind11/stl.h>

#include "bindings.hpp"
#include "xcalib/judge/documents.hpp"

namespace xcalib {

namespace py = pybind11;

void bind_documents(py::module_& m) {
    m.def("report_document", &report_document, py::arg("report"), py::arg("rig_file"),
          py::arg("files"),
          "JSON text of a report, as `xcalib calibrate --report` writes it; files: those of its "
          "frames.");
    m.def("evaluation_document", &evaluation_document, py::arg("evaluation"), py::arg("rig_file"),
          py::arg("files"),
          "JSON text of an Evaluation, as `xcalib evaluate --json` writes it; files: those of its "
          "frames.");
    m.def("rig_document", &rig_document, py::arg("rig"),
          "JSON text of describe(), as `xcalib inspect --json` prints it.");
}

}  // namespace xcalib

#include <pybind11/stl.h>

#include "bindings.hpp"
#include "xcalib/judge/documents.hpp"

namespace xcalib {

namespace py = pybind11;

void bind_documents(py::module_& m) {
    using Frame = std::tuple<std::string, bool, std::string>;
    m.def(
        "report_document",
        [](const CalibrationReport& report, const std::string& rig_file,
           const std::vector<std::string>& files, const std::vector<std::string>& arguments,
           const std::string& directory, int lag, const std::vector<Frame>& choice) {
            RunFacts run{"xcalib", arguments, directory, lag, {}};
            for (const auto& [file, taken, reason] : choice)
                run.choice.push_back({file, taken, reason});
            return report_document(report, rig_file, files, run);
        },
        py::arg("report"), py::arg("rig_file"), py::arg("files"), py::arg("arguments"),
        py::arg("directory"), py::arg("lag"), py::arg("choice"),
        R"(JSON text of a report, as `xcalib calibrate --report` writes it.

files: those of its frames. arguments: of `xcalib`, which was run in directory. lag: of the
sources, that was taken up [frames]. choice: (file, taken, reason) of the frames looked at.)");
    m.def("evaluation_document", &evaluation_document, py::arg("evaluation"), py::arg("rig_file"),
          py::arg("files"),
          "JSON text of an Evaluation, as `xcalib evaluate --json` writes it; files: those of its "
          "frames.");
    m.def("rig_document", &rig_document, py::arg("rig"),
          "JSON text of describe(), as `xcalib inspect --json` prints it.");
}

}  // namespace xcalib

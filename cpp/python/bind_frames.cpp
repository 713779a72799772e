#include <pybind11/functional.h>
#include <pybind11/stl.h>

#include "bindings.hpp"
#include "from_python.hpp"
#include "xcalib/stream/frames.hpp"
#include "xcalib/stream/plan.hpp"

namespace xcalib {

void bind_frames(py::module_& m) {
    m.def(
        "load_frames",
        [](StreamPointer references, StreamPointer sources, py::object depth,
           const std::vector<int>& chosen, const std::function<void(int)>& progress) {
            const Frames frames{std::move(references), std::move(sources),
                                std::make_shared<PythonDepth>(std::move(depth))};
            LoadedFrames loaded;
            {
                const py::gil_scoped_release unlocked;
                loaded = load_frames(frames, chosen, progress);
            }
            py::list images[3];
            for (const Frame& frame : loaded.frames) {
                images[0].append(frame.reference);
                images[1].append(frame.source);
                images[2].append(frame.depth);
            }
            return py::make_tuple(
                loaded.indices, images[0], images[1], images[2],
                loaded.failures ? left_out(loaded.failures, loaded.first_failure) : "");
        },
        py::arg("references"), py::arg("sources"), py::arg("depth"), py::arg("chosen"),
        py::arg("progress"),
        R"((indices, references, sources, depths, line) of the chosen frames, in memory.

Those that cannot be decoded are left out, and line says how many, or is ''; if none is left, raises
DecodeError of the first. progress(done) is called after each.)");
    m.def(
        "plan_text",
        [](StreamPointer references, StreamPointer sources, py::object depth,
           const std::vector<int>& chosen) {
            const Frames frames{std::move(references), std::move(sources),
                                std::make_shared<PythonDepth>(std::move(depth))};
            const py::gil_scoped_release unlocked;
            return plan_text(frames, chosen);
        },
        py::arg("references"), py::arg("sources"), py::arg("depth"), py::arg("chosen"),
        "What a run would read and pair, and the frames chosen to calibrate on where there are "
        "any, "
        "a "
        "line each; of long footage the first and the last.");
    m.def("left_out", &left_out, py::arg("count"), py::arg("first"),
          "The warning that frames were left out of a calibration, and why the first was.");
    m.def("with_file_name", &with_file_name, py::arg("message"), py::arg("images"),
          py::arg("chosen"),
          "The message with the file that the core, which sees arrays only, calls `frame N`.");
}

}  // namespace xcalib

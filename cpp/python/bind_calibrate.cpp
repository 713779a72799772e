#include <pybind11/functional.h>
#include <pybind11/stl.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "calibrate/study.hpp"
#include "value_class.hpp"
#include "xcalib/draw_frames.hpp"

namespace xcalib {
namespace {

// What a flow provider returned, as a field with a vector at every pixel.
FlowField field_from(const py::object& returned, int width, int height) {
    const char* expected =
        "flow provider: expected (flow, confidence), arrays (H, W, 2) and (H, W) of the images' ";
    const auto refuse = [&](const std::string& got) {
        throw py::value_error(expected + std::to_string(width) + "x" + std::to_string(height) +
                              ", got " + got);
    };
    if (!py::isinstance<py::sequence>(returned) || py::len(returned) != 2)
        refuse(py::type::of(returned).attr("__name__").cast<std::string>());
    using Floats = py::array_t<float, py::array::c_style | py::array::forcecast>;
    const py::sequence pair = returned;
    const Floats flow = Floats::ensure(pair[0]), confidence = Floats::ensure(pair[1]);
    if (!flow || flow.ndim() != 3 || flow.shape(0) != height || flow.shape(1) != width ||
        flow.shape(2) != 2)
        refuse(flow ? "flow of " + shape_text(flow) : "no array of flow");
    if (!confidence || confidence.ndim() != 2 || confidence.shape(0) != height ||
        confidence.shape(1) != width)
        refuse(confidence ? "confidence of " + shape_text(confidence) : "no array of confidence");
    const std::size_t count = static_cast<std::size_t>(width) * height;
    FlowField field{width,
                    height,
                    1,
                    std::vector<float>(count),
                    std::vector<float>(count),
                    std::vector<float>(confidence.data(), confidence.data() + count)};
    for (std::size_t i = 0; i < count; ++i) {
        field.x[i] = flow.data()[2 * i];
        field.y[i] = flow.data()[2 * i + 1];
    }
    return field;
}

// A flow provider of Python's as the core calls it, from any thread.
FlowEstimator estimator_of(const py::object& flow) {
    if (flow.is_none()) return nullptr;
    return [&flow](const Image& reference, const Image& warped,
                   const std::vector<std::uint8_t>& valid) {
        const py::gil_scoped_acquire gil;
        const int width = reference.width, height = reference.height;
        return field_from(
            flow(array_of(reference), array_of(warped), array_of(valid, width, height)), width,
            height);
    };
}

CalibrationResult calibrated_parts(const Parts& parts, const py::object& references,
                                   const py::object& sources, const py::object& depths,
                                   const std::optional<Rig>& initial,
                                   const CalibrationOptions& options, const py::object& progress,
                                   const py::object& flow) {
    const HeldList r = list_of("reference", references, image_of);
    const HeldList s = list_of("source", sources, image_of);
    const HeldList d = list_of("depth", depths, metric_depth_of);
    const Progress notify = [&progress](const std::string& stage, double share) {
        const py::gil_scoped_acquire gil;
        if (PyErr_CheckSignals() != 0) throw py::error_already_set();  // Ctrl-C
        if (!progress.is_none()) progress(stage, share);
    };
    const FlowEstimator estimator = estimator_of(flow);
    const py::gil_scoped_release released;
    return calibrate_parts(parts, r.views, s.views, d.views, initial, options, notify, estimator);
}

CalibrationResult calibrated(const py::object& references, const py::object& sources,
                             const py::object& depths, const std::optional<Rig>& initial,
                             const CalibrationOptions& options, const py::object& progress,
                             const py::object& flow) {
    return calibrated_parts({}, references, sources, depths, initial, options, progress, flow);
}

void bind_parts(py::module_& m) {
    ValueClass<Parts>(m, "_Parts", "Parts of the method, for ablation studies: all belong on.")
        .def_options()
        .def_readwrite("images", &Parts::images, "")
        .def_readwrite("pyramid", &Parts::pyramid, "")
        .def_readwrite("stages", &Parts::stages, "")
        .def_readwrite("floor", &Parts::floor, "")
        .def_readwrite("pair_weights", &Parts::pair_weights, "")
        .def_readwrite("normalization", &Parts::normalization, "")
        .def_readwrite("depth_edges", &Parts::depth_edges, "")
        .as_value();
    m.def("_calibrate", &calibrated_parts, py::arg("parts"), py::arg("references"),
          py::arg("sources"), py::arg("depths"), py::arg("initial") = py::none(),
          py::arg_v("options", CalibrationOptions{}, "CalibrationOptions()"),
          py::arg("progress") = py::none(), py::arg("flow") = py::none(),
          "calibrate() with parts of the method off.");
}

}  // namespace

void bind_calibrate(py::module_& m) {
    ValueClass<CalibrationResult>(m, "CalibrationResult", "What calibrate() returns.")
        .def_readonly("rig", &CalibrationResult::rig, "The best rig found.")
        .def_readonly("converged", &CalibrationResult::converged, "Is it to be trusted?")
        .def_readonly("report", &CalibrationResult::report, "CalibrationReport.")
        .def("__repr__",
             [](const CalibrationResult& result) {
                 return "CalibrationResult(" + std::string(py::repr(py::cast(result.rig))) + ", " +
                        result.report.brief() + ")";
             })
        .as_value(true);

    m.def("draw_frames", &draw_frames, py::arg("count"), py::arg("max_frames"), py::arg("seed"),
          "Indices of max_frames of count frames, spread over all, drawn with seed; sorted.");

    m.def("calibrate", &calibrated, py::arg("references"), py::arg("sources"), py::arg("depths"),
          py::arg("initial") = py::none(),
          py::arg_v("options", CalibrationOptions{}, "CalibrationOptions()"),
          py::arg("progress") = py::none(), py::arg("flow") = py::none(),
          R"(Estimates the rig from footage and depth, without a target.

references, sources: lists (or other iterables) of (H, W) or (H, W, 3) uint8 | uint16 | float32 images, colour as
blue-green-red, pairs by index; depths: (h, w) float32 [m], any size of the reference's aspect, 0 / NaN / inf unknown.
initial: Rig to start from. progress: called with (stage, share of the work done). flow: a
provider as in xcalib.flow, for the flow term; None is the built-in patch flow.
Images are copied only where they are not contiguous and aligned.

Raises ValueError, naming the frame, on unusable input. Not to converge is a result:
see CalibrationResult.converged.)");
    bind_parts(m);
}

}  // namespace xcalib

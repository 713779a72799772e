#include <pybind11/stl.h>

#include "bindings.hpp"
#include "xcalib/calibration_report.hpp"

namespace xcalib {
namespace {

namespace py = pybind11;

constexpr double kDegree = 3.14159265358979323846 / 180;

py::dict time_of(const CalibrationReport& report) {
    const CalibrationTimes& time = report.time;
    return py::dict(py::arg("prepare") = time.prepare, py::arg("search") = time.search,
                    py::arg("warp") = time.warp, py::arg("value") = time.value,
                    py::arg("jacobian") = time.jacobian, py::arg("solver") = time.solver);
}

py::dict dict_of(const CalibrationReport& report) {
    py::list candidates, levels, steps;
    for (const AdamStep& s : report.steps)
        steps.append(py::dict(py::arg("learning_rate") = s.learning_rate,
                              py::arg("image") = s.image, py::arg("flow") = s.flow,
                              py::arg("prior") = s.prior, py::arg("total") = s.total));
    for (const CandidateReport& c : report.candidates)
        candidates.append(
            py::dict(py::arg("score") = c.score, py::arg("correlation") = c.correlation,
                     py::arg("overlap") = c.overlap, py::arg("refined_nec") = c.refined_nec,
                     py::arg("reference_hfov_deg") = c.refined.reference.hfov() / kDegree,
                     py::arg("source_hfov_deg") = c.refined.source.hfov() / kDegree));
    for (const LevelReport& l : report.levels)
        levels.append(
            py::dict(py::arg("factor") = l.factor, py::arg("stage") = l.stage,
                     py::arg("width") = l.width, py::arg("height") = l.height,
                     py::arg("iterations") = l.iterations, py::arg("initial_cost") = l.initial_cost,
                     py::arg("final_cost") = l.final_cost, py::arg("nec") = l.nec,
                     py::arg("aligned") = l.aligned, py::arg("valid_share") = l.valid_share,
                     py::arg("condition_number") = l.condition_number,
                     py::arg("seconds") = l.seconds, py::arg("stopped") = l.stopped));
    return py::dict(
        py::arg("converged") = report.converged, py::arg("message") = report.message,
        py::arg("seconds") = report.seconds, py::arg("time") = time_of(report),
        py::arg("working_width") = report.working_width,
        py::arg("working_height") = report.working_height, py::arg("nec") = report.nec,
        py::arg("baseline_nec") = report.baseline_nec, py::arg("contrast") = report.contrast,
        py::arg("repeatability_px") = report.repeatability_px,
        py::arg("visible_shift_px") = report.visible_shift_px,
        py::arg("valid_share") = report.valid_share, py::arg("frames") = report.frames,
        py::arg("candidates") = candidates, py::arg("levels") = levels, py::arg("steps") = steps);
}

void bind_level_report(py::module_& m) {
    py::class_<LevelReport>(m, "LevelReport", "One solve: a stage at a level of the pyramid.")
        .def_readonly("factor", &LevelReport::factor, "Reduction of the working images.")
        .def_readonly("stage", &LevelReport::stage, "1 or 2, as in the paper.")
        .def_readonly("width", &LevelReport::width, "[px]")
        .def_readonly("height", &LevelReport::height, "[px]")
        .def_readonly("iterations", &LevelReport::iterations, "Of Levenberg-Marquardt.")
        .def_readonly("initial_cost", &LevelReport::initial_cost,
                      "Eq. (image_loss), and, where they act, the flow term and the prior.")
        .def_readonly("final_cost", &LevelReport::final_cost, "The same at the end.")
        .def_readonly("nec", &LevelReport::nec, "Mean over the pairs, weighted by c_i.")
        .def_readonly("aligned", &LevelReport::aligned, "The same, beyond what chance gives.")
        .def_readonly("valid_share", &LevelReport::valid_share,
                      "Share of the reference's edge energy that the source covers.")
        .def_readonly("condition_number", &LevelReport::condition_number,
                      "Of the normal equations, columns scaled to unit norm.")
        .def_readonly("seconds", &LevelReport::seconds, "[s]")
        .def_readonly("stopped", &LevelReport::stopped, "Why it stopped.");
}

void bind_candidate_report(py::module_& m) {
    py::class_<CandidateReport>(m, "CandidateReport",
                                "A peak of the search, and what became of it.")
        .def_readonly("score", &CandidateReport::score, "Contrast against the typical value.")
        .def_readonly("correlation", &CandidateReport::correlation,
                      "Pooled over the frames, of doubled angles, in [-1, 1].")
        .def_readonly("overlap", &CandidateReport::overlap, "Of both images' edges.")
        .def_readonly("refined_nec", &CandidateReport::refined_nec, "After the coarse levels.")
        .def_readonly("found", &CandidateReport::found, "Rig, by the search.")
        .def_readonly("refined", &CandidateReport::refined, "Rig, after the coarse levels.");
}

void bind_adam_step(py::module_& m) {
    py::class_<AdamStep>(m, "AdamStep", "Before a step of Adam is taken: means over its batch.")
        .def_readonly("learning_rate", &AdamStep::learning_rate, "Of the step.")
        .def_readonly("image", &AdamStep::image, "Eq. (image_loss).")
        .def_readonly("flow", &AdamStep::flow, "Eq. (flow_loss), in half widths of the reference.")
        .def_readonly("prior", &AdamStep::prior, "Eq. (camera_regularization).")
        .def_readonly("total", &AdamStep::total, "Eq. (total_loss).");
}

}  // namespace

void bind_calibration_report(py::module_& m) {
    bind_level_report(m);
    bind_candidate_report(m);
    bind_adam_step(m);
    py::class_<CalibrationReport>(m, "CalibrationReport", "How a calibration went.")
        .def_readonly("converged", &CalibrationReport::converged, "Is the rig to be trusted?")
        .def_readonly("message", &CalibrationReport::message, "Why, in one line.")
        .def_readonly("seconds", &CalibrationReport::seconds, "[s]")
        .def_property_readonly(
            "time", &time_of,
            "Where they go [s]: `prepare` (working images and their pyramid), `search`, `warp`\n"
            "(reprojection and sampling of the passes over image pairs), `value` (the rest of the\n"
            "passes without derivatives), `jacobian` (the rest of those with them), `solver` "
            "(Ceres\n"
            "itself). Of what threads do side by side, their sum divided by their number.")
        .def_readonly("working_width", &CalibrationReport::working_width, "[px]")
        .def_readonly("working_height", &CalibrationReport::working_height, "[px]")
        .def_readonly("nec", &CalibrationReport::nec, "At the finest level.")
        .def_readonly("baseline_nec", &CalibrationReport::baseline_nec,
                      "Typical of rigs displaced by many pixels.")
        .def_readonly("contrast", &CalibrationReport::contrast,
                      "Of the NEC above the baseline, in deviations over displacements.")
        .def_readonly("repeatability_px", &CalibrationReport::repeatability_px,
                      "Median distance between fits to two halves of the frames [working px].")
        .def_readonly(
            "visible_shift_px", &CalibrationReport::visible_shift_px,
            "Of the shift, linear over the image, that flow between the registered images\n"
            "still sees: the length that 90 % of the pixels do not exceed [working px];\n"
            "NaN where it cannot tell.")
        .def_readonly("valid_share", &CalibrationReport::valid_share,
                      "Of the reference's edge energy.")
        .def_readonly("frames", &CalibrationReport::frames, "Indices of the pairs used.")
        .def_readonly("candidates", &CalibrationReport::candidates,
                      "Of the search, best score first.")
        .def_readonly("levels", &CalibrationReport::levels, "In the order solved.")
        .def_readonly("steps", &CalibrationReport::steps, "AdamStep, of solver 'adam'.")
        .def("brief", &CalibrationReport::brief, "One line.")
        .def("full", &CalibrationReport::full, "A table.")
        .def("to_dict", &dict_of, "Plain lists and numbers, as for JSON.");
}

}  // namespace xcalib

#include <pybind11/stl.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "json.hpp"
#include "value_class.hpp"
#include "xcalib/calibrate.hpp"
#include "xcalib/error_field.hpp"

namespace xcalib {
namespace {

namespace py = pybind11;

void bind_level_report(py::module_& m) {
    ValueClass<LevelReport>(m, "LevelReport", "One solve: a stage at a level of the pyramid.")
        .def_readonly("factor", &LevelReport::factor, "Reduction of the working images.")
        .def_readonly("stage", &LevelReport::stage, "1 or 2, as in the paper.")
        .def_readonly("width", &LevelReport::width, "[px]")
        .def_readonly("height", &LevelReport::height, "[px]")
        .def_readonly("iterations", &LevelReport::iterations, "Iterations of Levenberg-Marquardt.")
        .def_readonly("initial_cost", &LevelReport::initial_cost,
                      "Eq. (image_loss), and, where they act, the flow term and the prior.")
        .def_readonly("final_cost", &LevelReport::final_cost, "The same at the end.")
        .def_readonly("nec", &LevelReport::nec, "Mean over the pairs, weighted by c_i.")
        .def_readonly("aligned", &LevelReport::aligned, "The same, beyond what chance gives.")
        .def_readonly("valid_share", &LevelReport::valid_share,
                      "Share of the reference's edge energy that the source covers.")
        .def_readonly("condition_number", &LevelReport::condition_number,
                      "Condition number of the normal equations, columns scaled to unit norm.")
        .def_readonly("seconds", &LevelReport::seconds, "[s]")
        .def_readonly("stopped", &LevelReport::stopped, "Why it stopped.")
        .as_value();
}

void bind_candidate_report(py::module_& m) {
    ValueClass<CandidateReport>(m, "CandidateReport",
                                "A peak of the search, and what became of it.")
        .def_readonly("score", &CandidateReport::score, "Contrast against the typical value.")
        .def_readonly("correlation", &CandidateReport::correlation,
                      "Pooled over the frames, of doubled angles, in [-1, 1].")
        .def_readonly("overlap", &CandidateReport::overlap, "Overlap of both images' edges.")
        .def_readonly("refined_nec", &CandidateReport::refined_nec, "After the coarse levels.")
        .def_readonly("found", &CandidateReport::found, "Rig, by the search.")
        .def_readonly("refined", &CandidateReport::refined, "Rig, after the coarse levels.")
        .as_value();
}

void bind_lens_report(py::module_& m) {
    ValueClass<LensReport>(m, "LensReport", "What k1 and k2 of the source's lens are worth.")
        .def_readonly("tried", &LensReport::tried, "Was a lens fitted?")
        .def_readonly("coefficients", &LensReport::coefficients,
                      "Kept: 0, 1 (k1) or 2 (k1 and k2).")
        .def_readonly(
            "gain", &LensReport::gain,
            "In NEC by the last one that was tried, of frames that the fit has not seen:\n"
            "the mean; of all frames where they gain too little to look further.")
        .def_readonly("gain_deviation", &LensReport::gain_deviation,
                      "The standard deviation of that mean; 0 of all frames.")
        .as_value();
}

void bind_adam_step(py::module_& m) {
    ValueClass<AdamStep>(m, "AdamStep", "Before a step of Adam is taken: means over its batch.")
        .def_readonly("learning_rate", &AdamStep::learning_rate, "Learning rate of the step.")
        .def_readonly("image", &AdamStep::image, "Eq. (image_loss).")
        .def_readonly("flow", &AdamStep::flow, "Eq. (flow_loss), in half widths of the reference.")
        .def_readonly("prior", &AdamStep::prior, "Eq. (camera_regularization).")
        .def_readonly("total", &AdamStep::total, "Eq. (total_loss).")
        .as_value();
}

void bind_lag_report(py::module_& m) {
    ValueClass<LagFit>(m, "LagFit", "The fit with the sources some frames later, refitted.")
        .def_readonly("lag", &LagFit::lag,
                      "That a source is later than its own frame [source frames].")
        .def_readonly("frames", &LagFit::frames, "References that have such a source.")
        .def_readonly("factor", &LagFit::factor,
                      "Reduction of the level of the last fit: better lags are fitted further.")
        .def_readonly("nec", &LagFit::nec, "Mean over the frames, there.")
        .def_readonly("gain", &LagFit::gain,
                      "NEC of a frame above the same with its own source, there: mean.")
        .def_readonly("error", &LagFit::error, "Standard error of the gain.")
        .def_readonly("rig", &LagFit::rig, "Rig, refitted.")
        .as_value();
    ValueClass<LagReport>(m, "LagReport", "By how much the source is late beside its pairing.")
        .def_readonly("frames", &LagReport::frames,
                      "[source frames]; 0 too where the fits do not show it.")
        .def_readonly("change", &LagReport::change,
                      "By how many frames the lag of the later half of the footage is the larger, "
                      "where the halves differ.")
        .def_readonly("fits", &LagReport::fits,
                      "LagFit, by rising lag; none where the footage is no sequence.")
        .def("line", &LagReport::line, "How the fits compare.")
        .as_value();
}

// What expected_error_map() is drawn from, as Python pickles it; None where there is none.
py::object kept(const ErrorField* errors) {
    if (!errors) return py::none();
    std::vector<int> parameters;
    for (int i = 0; i < errors->parameters.size(); ++i) parameters.push_back(errors->parameters[i]);
    const Eigen::MatrixXd& covariance = errors->covariance;
    return py::make_tuple(
        errors->rig, errors->halves,
        std::vector<double>{errors->unit, errors->floor, errors->disagreement}, parameters,
        std::vector<double>(covariance.data(), covariance.data() + covariance.size()),
        std::vector<double>(errors->step.data(), errors->step.data() + errors->step.size()));
}

std::shared_ptr<const ErrorField> error_field_of(const py::object& kept) {
    if (kept.is_none()) return nullptr;
    const auto state = kept.cast<py::tuple>();
    auto out = std::make_shared<ErrorField>();
    out->rig = state[0].cast<Rig>();
    out->halves = state[1].cast<std::vector<Rig>>();
    const auto lengths = state[2].cast<std::vector<double>>();
    out->unit = lengths.at(0), out->floor = lengths.at(1), out->disagreement = lengths.at(2);
    for (const int parameter : state[3].cast<std::vector<int>>()) out->parameters.add(parameter);
    const int size = out->parameters.size();
    const auto covariance = state[4].cast<std::vector<double>>(),
               step = state[5].cast<std::vector<double>>();
    if (covariance.size() != static_cast<std::size_t>(size) * size ||
        step.size() != static_cast<std::size_t>(size))
        throw py::value_error("CalibrationReport: pickled by another version");
    out->covariance = Eigen::Map<const Eigen::MatrixXd>(covariance.data(), size, size);
    out->step = Eigen::Map<const Eigen::VectorXd>(step.data(), size);
    return out;
}

}  // namespace

void bind_calibration_report(py::module_& m) {
    bind_level_report(m);
    bind_candidate_report(m);
    bind_lens_report(m);
    bind_adam_step(m);
    bind_lag_report(m);
    ValueClass<CalibrationReport>(m, "CalibrationReport", "How a calibration went.")
        .def_readonly("verdict", &CalibrationReport::verdict, "Verdict.")
        .def_readonly("converged", &CalibrationReport::converged, "Is the rig to be trusted?")
        .def_readonly("message", &CalibrationReport::message,
                      "Why, and what to do next, in one line.")
        .def_readonly("seconds", &CalibrationReport::seconds, "[s]")
        .def_property_readonly(
            "time",
            [](const CalibrationReport& report) { return object_of(json_of(report)["time"]); },
            "Where they go [s]: `prepare` (working images and their pyramid), `search`, `warp`\n"
            "(reprojection and sampling of the passes over image pairs), `value` (the rest of the\n"
            "passes without derivatives), `jacobian` (the rest of those with them), `solver` "
            "(Ceres\n"
            "itself): the sum over threads divided by their number.")
        .def_readonly("working_width", &CalibrationReport::working_width, "[px]")
        .def_readonly("working_height", &CalibrationReport::working_height, "[px]")
        .def_readonly("nec", &CalibrationReport::nec, "At the finest level.")
        .def_readonly("baseline_nec", &CalibrationReport::baseline_nec,
                      "Typical of rigs displaced by many pixels.")
        .def_readonly("contrast", &CalibrationReport::contrast,
                      "NEC above the baseline, in deviations over displacements.")
        .def_readonly(
            "repeatability_px", &CalibrationReport::repeatability_px,
            "Median distance between the calibrations of two halves of the frames [working px].")
        .def_readonly(
            "visible_shift_px", &CalibrationReport::visible_shift_px,
            "Shift, linear over the image, that flow between the registered images still sees:\n"
            "the length that 90 % of the pixels do not exceed [working px]; NaN where it is not\n"
            "known.")
        .def_readonly("valid_share", &CalibrationReport::valid_share,
                      "Share of the reference's edge energy.")
        .def_readonly("weak_directions", &CalibrationReport::weak_directions,
                      "What can slide, and with what, while the footage's pixels move by a tenth "
                      "of a pixel.")
        .def_readonly("near_m", &CalibrationReport::near_m, "Depth that 5 % are nearer than [m].")
        .def_readonly("middle_m", &CalibrationReport::middle_m, "Median depth [m].")
        .def_readonly("far_m", &CalibrationReport::far_m, "Depth that 95 % are nearer than [m].")
        .def_readonly("frames", &CalibrationReport::frames, "Indices of the pairs used.")
        .def_readonly("candidates", &CalibrationReport::candidates,
                      "Candidates of the search, best score first.")
        .def_readonly("levels", &CalibrationReport::levels, "In the order solved.")
        .def_readonly("lens", &CalibrationReport::lens, "LensReport, of solver 'ceres'.")
        .def_readonly("steps", &CalibrationReport::steps, "AdamStep, of solver 'adam'.")
        .def_readonly("lag", &CalibrationReport::lag, "LagReport, where the footage is a sequence.")
        .def(
            "expected_error_map",
            [](const CalibrationReport& report, double depth, int width, int height, double share) {
                return array_of(expected_error_map(report, depth, width, height, share));
            },
            py::arg("depth"), py::arg("width") = 64, py::arg("height") = 48, py::arg("share") = 0.5,
            "(height, width) float32 over the reference image: the length that `share` of the "
            "errors at a depth [m] do not exceed [px of the reference when its width is 640 px]; "
            "NaN where the source sees nothing.")
        .def("brief", &CalibrationReport::brief, "One line.")
        .def("full", &CalibrationReport::full, "A table.")
        .def(
            "to_dict", [](const CalibrationReport& report) { return object_of(json_of(report)); },
            "Plain lists and numbers, as for JSON.")
        .keep_unseen(&CalibrationReport::time)
        .keep_as([](const CalibrationReport& report) { return kept(report.errors.get()); },
                 [](CalibrationReport& report, const py::object& errors) {
                     report.errors = error_field_of(errors);
                 })
        .as_value();
}

}  // namespace xcalib

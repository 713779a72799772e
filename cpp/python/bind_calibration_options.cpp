#include <pybind11/stl.h>

#include <map>

#include "bindings.hpp"
#include "value_class.hpp"
#include "xcalib/calibration_options.hpp"
#include "xcalib/footage/pairing.hpp"
#include "xcalib/mount.hpp"

namespace xcalib {
namespace {

void bind_search_options(py::module_& m) {
    ValueClass<SearchOptions> options(m, "SearchOptions",
                                      "The global search that starts a calibration.");
    options.def_options();
    options
        .def_word("mode", &SearchOptions::mode, "search mode",
                  "auto (full without an initial rig, local with one), full, local or off.")
        .def_readwrite("max_fov_ratio", &SearchOptions::max_fov_ratio,
                       "Largest ratio of the two fields of view, either way, in tangents; > 1.")
        .def_readwrite("max_roll_deg", &SearchOptions::max_roll_deg, "[deg], in [0, 180].")
        .def_readwrite("min_overlap", &SearchOptions::min_overlap,
                       "Geometric mean of the shares of both images' edges, in (0, 1).")
        .def_readwrite("map_width", &SearchOptions::map_width, "Width searched at [px], >= 32.")
        .def_readwrite("candidates", &SearchOptions::candidates,
                       "Peaks refined before one is chosen, >= 1.")
        .def("validate", &SearchOptions::validate,
             "Raises ValueError naming the field, its value and the allowed range.")
        .as_value();
}

void bind_adam_options(py::module_& m) {
    ValueClass<AdamOptions>(m, "AdamOptions",
                            "The published schedule. Keyword arguments set fields.")
        .def_options()
        .def_readwrite("epochs", &AdamOptions::epochs, ">= 1")
        .def_readwrite("batch", &AdamOptions::batch, "Pairs, >= 1.")
        .def_readwrite("learning_rate", &AdamOptions::learning_rate,
                       "Learning rate of stage 1, > 0.")
        .def_readwrite("fine_learning_rate", &AdamOptions::fine_learning_rate,
                       "Learning rate of stage 2, > 0.")
        .def_readwrite("decay", &AdamOptions::decay, "Factor of either with each step, in (0, 1].")
        .def_readwrite("fine_from", &AdamOptions::fine_from,
                       "Share of all steps at which stage 2 begins, in [0, 1].")
        .def_readwrite("translation_scales", &AdamOptions::translation_scales,
                       "Scales of Eq. (translation), 1 to 3.")
        .def("validate", &AdamOptions::validate,
             "Raises ValueError naming the field, its value and the allowed range.")
        .as_value();
}

void bind_tolerance(py::module_& m) {
    ValueClass<Tolerance>(m, "Tolerance",
                          "The expected error up to which a calibration is trusted [px of the\n"
                          "reference when its width is 640 px].")
        .def_options()
        .def_readwrite("median", &Tolerance::median, "Over the footage's own depths, > 0.")
        .def_readwrite("p95", &Tolerance::p95, "Of 95 % of them, > 0.")
        .def_static("parse", &Tolerance::parse, py::arg("option"), py::arg("text"),
                    "'2,5' as an option gives it, or '2': 95 % within 2.5 times the median. "
                    "InputError names the option.")
        .as_value();
}

void bind_cameras(ValueClass<CalibrationOptions>& options) {
    options
        .def_readwrite("reference_camera", &CalibrationOptions::reference_camera,
                       "Known intrinsics, frozen, or None.")
        .def_readwrite("source_camera", &CalibrationOptions::source_camera,
                       "Known intrinsics, frozen, or None.")
        .def_readwrite("reference_lens", &CalibrationOptions::reference_lens,
                       "Lens of the reference's images, frozen. None: that of reference_camera or "
                       "of the initial rig, or none.")
        .def_readwrite("source_lens", &CalibrationOptions::source_lens,
                       "Lens of the source's images, frozen. None: that of source_camera or of "
                       "the initial rig; else k1 and k2 are estimated and kept where unseen frames "
                       "gain.")
        .def_readwrite("reference_hfov_deg", &CalibrationOptions::reference_hfov_deg,
                       "Horizontal field of view to assume [deg], or None to search it.")
        .def_readwrite("optimize_reference", &CalibrationOptions::optimize_reference,
                       "Free the reference's intrinsics too; they are coupled with the source's. "
                       "The solver 'adam' always does.")
        .def_readwrite("optimize_lens", &CalibrationOptions::optimize_lens,
                       "Free k1 and k2 of the source's lens, from source_lens where it is given, "
                       "and keep them whether or not unseen frames gain; the solver 'adam' has a "
                       "lens so only.")
        .def_readwrite("relative_depth", &CalibrationOptions::relative_depth,
                       "RelativeDepth that the depth maps were made with: the shift is estimated, "
                       "the scale kept, and the rig has both. None: metric depth.");
}

void bind_flow_term(ValueClass<CalibrationOptions>& options) {
    options
        .def_word("flow", &CalibrationOptions::flow, "flow",
                  "The flow term: 'auto' (where nothing is searched), 'on' (after a search too) or "
                  "'off'.")
        .def_readwrite("flow_weight", &CalibrationOptions::flow_weight,
                       "lambda of Eq. (total_loss); > 0.")
        .def_readwrite("flow_rounds", &CalibrationOptions::flow_rounds,
                       "Times at most that a stage at a level estimates flow; >= 1.");
}

// What the command asks for its options.
void bind_option_words(py::module_& m) {
    m.def(
        "_option_words",
        [] {
            return std::map<std::string, std::vector<std::string>>{
                {"search", names_of(words<SearchMode>())},
                {"solver", names_of(words<Solver>())},
                {"occlusion", names_of(words<Occlusion>())},
                {"pair", {kPairingMethods.begin(), kPairingMethods.end()}}};
        },
        "The words that each option of the command takes.");
    m.def(
        "_flow_arguments",
        [] {
            py::dict modes;
            for (const auto& [mode, word] : flow_arguments()) modes[word] = word_of(mode);
            return modes;
        },
        "CalibrationOptions.flow by what --flow of the command takes.");
}

}  // namespace

void bind_calibration_options(py::module_& m) {
    bind_search_options(m);
    bind_adam_options(m);
    bind_tolerance(m);
    ValueClass<CalibrationOptions> options(m, "CalibrationOptions",
                                           "Options of calibrate(). Keyword arguments set fields.");
    options.def_options()
        .def_readwrite("max_frames", &CalibrationOptions::max_frames,
                       "Pairs used, spread over the footage; >= 1.")
        .def_readwrite("seed", &CalibrationOptions::seed, "Seed of the frame choice.")
        .def_readwrite("num_threads", &CalibrationOptions::num_threads, "0 uses every core.")
        .def_readwrite("working_width", &CalibrationOptions::working_width,
                       "References are reduced by a whole factor to at most this width [px].")
        .def_readwrite("max_iterations", &CalibrationOptions::max_iterations,
                       "Per stage and level; >= 1.")
        .def_readwrite("prior_weight", &CalibrationOptions::prior_weight,
                       "gamma of Eq. (total_loss), in stage 1; >= 0.");
    bind_flow_term(options);
    bind_cameras(options);
    options
        .def_seen(
            "mount", [](const CalibrationOptions& o) { return Mount::word(o.mount); },
            [](CalibrationOptions& o, const std::string& word) {
                o.mount = Mount::parse("mount", word);
            },
            "How the source image is turned: 'auto' (upright, and where that is not found any), "
            "'upright', degrees clockwise as '90', 'mirrored', or both as 'mirrored-90'.")
        .def_readwrite("search", &CalibrationOptions::search, "SearchOptions.")
        .def_readwrite("tolerance", &CalibrationOptions::tolerance, "Tolerance.");
    options
        .def_word("solver", &CalibrationOptions::solver, "solver",
                  "'ceres', or 'adam' as published, which searches nothing.")
        .def_readwrite("adam", &CalibrationOptions::adam, "AdamOptions.")
        .def("validate", &CalibrationOptions::validate,
             "Raises ValueError naming the field, its value and the allowed range.")
        .as_value();
    bind_option_words(m);
}

}  // namespace xcalib

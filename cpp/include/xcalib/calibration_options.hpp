// How to calibrate.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "xcalib/camera.hpp"
#include "xcalib/export.hpp"
#include "xcalib/mount.hpp"

namespace XCALIB_EXPORT xcalib {

enum class SearchMode {
    automatic,  // full without an initial rig, local with one
    full,       // any displacement, ratio of fields of view and roll below
    local,      // around the initial rig: 15 % of its width, 15 % of its scale, 3 deg of roll
    off,        // start at the initial rig, or at the paper's 45 deg where there is none
};

enum class FlowMode {
    automatic,  // on where nothing is searched, since it leads from further off than edges do,
                // and with an estimator of the caller
    on,         // after a search too, from stage 2 on, where it changes little
    off,
};

enum class Solver {
    ceres,  // Levenberg-Marquardt on a pyramid, after a search
    adam,   // the paper's, from the initial rig or its 45 deg start; nothing is searched
};

// The published schedule.
struct AdamOptions {
    int epochs = 15;                   // >= 1
    int batch = 4;                     // pairs, >= 1
    double learning_rate = 5e-3;       // of stage 1, > 0
    double fine_learning_rate = 5e-4;  // of stage 2, > 0
    double decay = 0.98;               // of either by a step, (0, 1]
    double fine_from = 0.75;           // of all steps, where stage 2 begins, [0, 1]
    int translation_scales = 2;        // of Eq. (translation), 1 to 3

    void validate() const;  // throws std::invalid_argument: field, value, range
};

struct SearchOptions {
    SearchMode mode = SearchMode::automatic;
    double max_fov_ratio = 2.5;  // of the tangents, either way, (1, 10]
    double max_roll_deg = 5.0;   // about the mount [deg], [0, 180]
    double min_overlap = 0.3;    // (0, 1): geometric mean of the shares of both images' edges
    int map_width = 96;          // [px], >= 32
    int candidates = 12;         // peaks considered, >= 1

    void validate() const;  // throws std::invalid_argument: field, value, range
};

// The expected error up to which a calibration is trusted, over the footage's own depths [px of the
// reference when its width is 640 px].
struct Tolerance {
    double median = 2.0;  // > 0
    double p95 = 5.0;     // > 0

    // "2,5" as an option gives it, or "2": 95 % within 2.5 times the median. Throws InputError that
    // names the option.
    static Tolerance parse(const std::string& option, const std::string& text);
};

struct CalibrationOptions {
    int max_frames = 32;        // pairs used, spread over the footage, >= 1
    std::uint32_t seed = 0;     // of the frame choice
    int num_threads = 0;        // 0: every core
    int working_width = 640;    // [px]: references are reduced by a whole factor to at most this
    int max_iterations = 100;   // per stage and level, >= 1
    double prior_weight = 1.0;  // gamma of Eq. (total_loss), stage 1 only, >= 0
    FlowMode flow = FlowMode::automatic;  // the flow term
    double flow_weight = 2.5;             // lambda of Eq. (total_loss), > 0
    int flow_rounds = 3;                  // times at most that a stage estimates flow, >= 1

    // Known intrinsics are taken as they are and frozen.
    std::optional<Pinhole> reference_camera;
    std::optional<Pinhole> source_camera;
    // Known lenses of the images as they are, taken and frozen, before any that a camera above or
    // the initial rig has. None: those, or no lens; but k1 and k2 of a source without one are
    // estimated, and kept where frames gain by them that the fit has not seen.
    std::optional<Lens> reference_lens;
    std::optional<Lens> source_lens;
    // Start of the reference's horizontal field of view; searched where neither is given. (0, 180)
    std::optional<double> reference_hfov_deg;
    // The reference's intrinsics and the source's are coupled (a gauge): free only on request, save
    // with Solver::adam, which frees them as published.
    bool optimize_reference = false;
    // k1 and k2 of the source's lens move with everything else, from those of `source_lens` where
    // it is given, and are kept whether or not unseen frames gain by them; with Solver::adam too.
    bool optimize_lens = false;

    // The depth maps are 1 / (scale r + shift) of relative inverse depth: the shift is estimated,
    // the scale stays as the gauge of the translation, and the rig has both. None: metric.
    std::optional<RelativeDepth> relative_depth;

    // None: upright; where that is not found, quarter turns, mirrors and all between are looked
    // for.
    std::optional<Mount> mount;
    SearchOptions search;
    Tolerance tolerance;
    Solver solver = Solver::ceres;
    AdamOptions adam;

    void validate() const;  // throws std::invalid_argument: field, value, range
};

}  // namespace xcalib

// Calibration: frames and depth in, one rig and a report out.
//
//     frames -> working images -> search -> pyramid (stage 1, stage 2) -> rig, verdict
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "xcalib/camera.hpp"
#include "xcalib/export.hpp"
#include "xcalib/flow.hpp"
#include "xcalib/image.hpp"

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
};

struct SearchOptions {
    SearchMode mode = SearchMode::automatic;
    double max_fov_ratio = 2.5;  // of the tangents, either way, (1, 10]
    double max_roll_deg = 5.0;   // [deg], >= 0
    double min_overlap = 0.3;    // (0, 1): geometric mean of the shares of both images' edges
    int map_width = 96;          // [px], >= 32
    int candidates = 12;         // peaks considered, >= 1
};

// Parts of the method, for a study of what each is worth (bench/experiments): all belong on.
struct Parts {
    bool images = true;         // the image loss; off, the flow term and the prior move the rig
    bool pyramid = true;        // off: what the search has found and placed is solved at full size
    bool stages = true;         // off: everything is free, without a prior, from the first level on
    bool floor = true;          // of the objective's edges; off: they count however weak
    bool pair_weights = true;   // c_i; off: every pair counts alike
    bool normalization = true;  // photometric; off: gray values as given
    bool depth_edges = true;    // are left out of the NEC at the finer levels; off: not
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
    // Start of the reference's horizontal field of view; searched where neither is given. (0, 180)
    std::optional<double> reference_hfov_deg;
    // The reference's intrinsics and the source's are coupled (a gauge): free only on request, save
    // with Solver::adam, which frees them as published.
    bool optimize_reference = false;

    // The depth maps are 1 / (scale r + shift) of relative inverse depth: the shift is estimated,
    // the scale stays as the gauge of the translation, and the rig has both. None: metric.
    std::optional<RelativeDepth> relative_depth;

    SearchOptions search;
    Solver solver = Solver::ceres;
    AdamOptions adam;
    Parts parts;

    void validate() const;  // throws std::invalid_argument: field, value, range
};

struct LevelReport {
    int factor = 1;  // of the reduction of the working images
    int stage = 1;   // of the paper: 1 with its frozen set and prior, 2 with all free
    int width = 0, height = 0;
    int iterations = 0;
    double initial_cost = 0.0, final_cost = 0.0;  // Eq. (image_loss), plus flow term and prior
    double nec = 0.0;                             // mean over the pairs, weighted by c_i
    double aligned = 0.0;                         // the same beyond what chance gives
    double valid_share = 0.0;       // of the reference's edge energy that the source covers
    double condition_number = 0.0;  // of the normal equations, columns scaled to unit norm
    double seconds = 0.0;
    std::string stopped;  // why
};

struct CandidateReport {
    double score = 0.0, correlation = 0.0, overlap = 0.0;  // as the search found it
    double refined_nec = 0.0;                              // after refinement at the coarse level
    Rig found;                                             // by the search
    Rig refined;                                           // after refinement at the coarse level
};

// A step of Adam, before it is taken: means over its batch.
struct AdamStep {
    double learning_rate = 0.0;
    double image = 0.0;  // Eq. (image_loss)
    double flow = 0.0;   // of Eq. (flow_loss), in half widths of the reference
    double prior = 0.0;  // Eq. (camera_regularization)
    double total = 0.0;  // Eq. (total_loss)
};

// Where the time of a calibration goes [s]. Of what threads do side by side, their sum divided by
// their number. What they leave is the verdict's bookkeeping, flow and waiting.
struct CalibrationTimes {
    double prepare = 0.0;   // working images and the levels of their pyramid
    double search = 0.0;    // the global search
    double warp = 0.0;      // reprojection and sampling of the passes over image pairs
    double value = 0.0;     // the rest of the passes that have no derivatives
    double jacobian = 0.0;  // the rest of those that have
    double solver = 0.0;    // Ceres, but for its evaluations
};

struct CalibrationReport {
    bool converged = false;
    std::string message;  // one line: why the result is, or is not, to be trusted
    double seconds = 0.0;
    CalibrationTimes time;
    int working_width = 0, working_height = 0;
    double nec = 0.0;               // at the finest level
    double baseline_nec = 0.0;      // at half that size, of the rig turned off its place
    double contrast = 0.0;          // of the NEC above that, in its deviations over displacements
    double repeatability_px = 0.0;  // between fits to two halves of the frames [working px]
    double visible_shift_px = 0.0;  // that flow still sees [working px]; NaN where it cannot tell
    double valid_share = 0.0;
    std::vector<int> frames;  // indices of the pairs used
    std::vector<CandidateReport> candidates;
    std::vector<LevelReport> levels;
    std::vector<AdamStep> steps;  // of Solver::adam

    std::string brief() const;  // one line
    std::string full() const;   // a table
};

struct CalibrationResult {
    Rig rig;
    bool converged = false;
    CalibrationReport report;
};

// Called with the stage and the share of all work done, (0, 1], from the calling thread.
using Progress = std::function<void(const std::string&, double)>;

// Flow from a reference, gray and normalized, to the warped source, gray too; both in [0, 1] and of
// one size. `valid`: nonzero where the warped source is. Called from the calling thread.
using FlowEstimator = std::function<FlowField(const Image& reference, const Image& warped,
                                              const std::vector<std::uint8_t>& valid)>;

// `max_frames` of `count` indices, spread over the whole, drawn with `seed`; sorted.
std::vector<int> choose_frames(int count, int max_frames, std::uint32_t seed);

// references[i], sources[i], depths[i] belong together; each list of one size (depth: any size of
// the reference's aspect, float32 metres in the reference camera, 0 / NaN / inf unknown).
// Throws std::invalid_argument, naming the frame, on unusable input. Not to converge is a result.
CalibrationResult calibrate(const std::vector<ImageView>& references,
                            const std::vector<ImageView>& sources,
                            const std::vector<ImageView>& depths,
                            const std::optional<Rig>& initial = std::nullopt,
                            const CalibrationOptions& options = {},
                            const Progress& progress = nullptr,
                            const FlowEstimator& flow = nullptr);

}  // namespace xcalib

// What a calibration found out about itself.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "xcalib/calibration_times.hpp"
#include "xcalib/camera.hpp"
#include "xcalib/export.hpp"
#include "xcalib/verdict.hpp"

namespace XCALIB_EXPORT xcalib {

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

// What k1 and k2 of the source are worth.
struct LensReport {
    bool tried = false;
    int coefficients = 0;  // that are kept: none, k1, or k1 and k2
    // In NEC by the last one that was tried, of frames that the fit has not seen: the mean, and its
    // standard deviation; of all frames where they gain too little to look further.
    double gain = 0.0, gain_deviation = 0.0;
};

// A step of Adam, before it is taken: means over its batch.
struct AdamStep {
    double learning_rate = 0.0;
    double image = 0.0;  // Eq. (image_loss)
    double flow = 0.0;   // of Eq. (flow_loss), in half widths of the reference
    double prior = 0.0;  // Eq. (camera_regularization)
    double total = 0.0;  // Eq. (total_loss)
};

struct ErrorField;  // error_field.hpp
// The fit with the sources some frames later, refitted.
struct LagFit {
    int lag = 0;         // that a source is later than its own frame [source frames]
    int frames = 0;      // of the references looked at, those that have such a source
    int factor = 1;      // of the level of the last fit: better lags are fitted further
    double nec = 0.0;    // mean over the frames, there
    double gain = 0.0;   // NEC of a frame above the same with its own source, there: mean
    double error = 0.0;  // of the gain: its standard error
    Rig rig;             // refitted
};

// By how much the source is late beside what it was paired with.
struct LagReport {
    int frames = 0;  // [source frames]; 0 too where the fits do not show it
    // By how many frames the lag of the later half of the footage is the larger, where the halves
    // differ: the source lost frames, or a pause of it was not counted.
    int change = 0;
    std::vector<LagFit> fits;  // by rising lag; none where the footage is no sequence

    const LagFit& at(int lag) const;  // which must be among them
    std::string line() const;         // how the fits compare
};

struct CalibrationReport {
    Verdict verdict;
    bool converged = false;  // verdict.trusted
    std::string message;     // one line: why the result is, or is not, to be trusted
    double seconds = 0.0;
    CalibrationTimes time;
    int working_width = 0, working_height = 0;
    double nec = 0.0;               // at the finest level
    double baseline_nec = 0.0;      // at half that size, of the rig turned off its place
    double contrast = 0.0;          // of the NEC above that, in its deviations over displacements
    double repeatability_px = 0.0;  // between calibrations of half of the frames each [working px]
    double visible_shift_px = 0.0;  // that flow still sees [working px]; NaN where it is not known
    double valid_share = 0.0;
    double near_m = 0.0, middle_m = 0.0, far_m = 0.0;  // depths that 5, 50 and 95 % are nearer than
    std::vector<int> frames;                           // indices of the pairs used
    std::vector<CandidateReport> candidates;
    std::vector<LevelReport> levels;
    LensReport lens;
    std::vector<AdamStep> steps;               // of Solver::adam
    std::shared_ptr<const ErrorField> errors;  // that are expected
    // What can slide, and with what, while the footage's pixels move by a tenth of a pixel.
    std::vector<std::string> weak_directions;
    LagReport lag;  // of fit_lags(), where the footage was a sequence

    std::string brief() const;  // one line
    std::string full() const;   // a table
};

}  // namespace xcalib

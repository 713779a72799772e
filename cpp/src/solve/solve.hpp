// One solve: a stage of the paper at a level of the pyramid.
#pragma once

#include "solve/flow_term.hpp"
#include "solve/plan.hpp"
#include "solve/working_images.hpp"
#include "xcalib/calibration_report.hpp"

namespace xcalib {

double seconds_now();

// Mean over the pairs, weighted by c_i (the valid share plainly).
NecValue pooled(const Level& level, const Rig& rig, int num_threads);

// The report of a rig at a level, but for what depends on how it was solved.
LevelReport report_on(const Level& level, int stage, const Rig& rig, int num_threads);

// The valid share below which a fit is penalised that starts where it is `valid_share`.
inline double share_limit(double valid_share) { return 0.8 * valid_share; }

// What moves in a stage at a level: all but the paper's frozen sets, and what is known.
struct Moving {
    Parameters parameters = Parameters(0);
    int lens_coefficients = 0;  // of k1 and k2
    // The principal point of the reference, and both of its focal lengths by the same.
    bool gauge = false;
};
// By which ordinary cameras differ from 55 deg, and from a principal point in the image's middle
// [widths].
inline constexpr double kLogFocalDeviation = 0.4, kCenterDeviation = 0.02;
Moving moving_parameters(int stage, int factor, const Plan& plan, const Rig& rig);

// Levenberg-Marquardt from `rig`, which is replaced. Stage 1 has the paper's frozen set and a prior
// that holds `anchor`, stage 2 everything free. A pair whose valid share falls below `share_limit`
// is penalised for it. It stops where a step lowers the cost by less than the share `tolerance`.
LevelReport solve_level(const Level& level, const std::vector<FlowTargets>& flow, int stage,
                        double share_limit, double tolerance, const Plan& plan, const Rig& anchor,
                        Rig& rig);

// The same, with the flow term of Eq. (total_loss) where the plan has it: flow is estimated where
// `rig` is, held while the solver moves, and estimated anew.
LevelReport solve_stage(const WorkingImages& images, const Level& level, int stage,
                        double share_limit, double tolerance, const Plan& plan, Rig& rig);

// Median distance between where two rigs send the pixels of a level, in reference pixels of the
// working size.
double median_distance(const Level& level, const Rig& a, const Rig& b);

}  // namespace xcalib

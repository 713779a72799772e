#include "xcalib/calibration_report.hpp"

#include "base/format.hpp"

namespace xcalib {
namespace {

constexpr double kDegrees = 180 / 3.14159265358979323846;

}  // namespace

std::string CalibrationReport::brief() const {
    return format(
        "%s: %s; %zu pairs, depths of %.3g to %.3g m (median %.3g), NEC %.3f (%.3f when "
        "displaced), %.0f %% of the edges covered, %.1f s",
        converged ? "converged" : "NOT converged", message.c_str(), frames.size(), near_m, far_m,
        middle_m, nec, baseline_nec, 100 * valid_share, seconds);
}

std::string CalibrationReport::full() const {
    std::string text = brief() + "\n";
    text += format(
        "working size %d x %d px; of %.1f s, %.1f to prepare images, %.1f search, %.1f warp, "
        "%.1f values, %.1f Jacobians, %.1f solver\n",
        working_width, working_height, seconds, time.prepare, time.search, time.warp, time.value,
        time.jacobian, time.solver);
    for (const std::string& weak : weak_directions)
        text += "for a tenth of a pixel could slide " + weak + "\n";
    text += "candidate   score   corr  overlap  refined  HFoV reference / source [deg]\n";
    for (std::size_t i = 0; i < candidates.size(); ++i) {
        const CandidateReport& c = candidates[i];
        text += format("%9zu  %6.3f  %5.3f  %7.2f  %7.4f  %5.1f / %5.1f\n", i + 1, c.score,
                       c.correlation, c.overlap, c.refined_nec,
                       c.refined.reference.hfov() * kDegrees, c.refined.source.hfov() * kDegrees);
    }
    text +=
        "level  stage  size       iterations  cost                  NEC     valid  condition   s  "
        "stopped\n";
    for (const LevelReport& l : levels)
        text +=
            format("1/%-3d  %5d  %4d x %-4d  %9d  %.5f -> %.5f  %.4f  %4.0f %%  %9.1e  %3.1f  %s\n",
                   l.factor, l.stage, l.width, l.height, l.iterations, l.initial_cost, l.final_cost,
                   l.nec, 100 * l.valid_share, l.condition_number, l.seconds, l.stopped.c_str());
    return text;
}

}  // namespace xcalib

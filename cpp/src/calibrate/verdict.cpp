#include "calibrate/verdict.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/format.hpp"
#include "calibrate/visible_shift.hpp"
#include "solve/solve.hpp"

namespace xcalib {
namespace {

constexpr double kPi = 3.14159265358979323846;

// Half resolution: fine enough to separate a fit from a near miss, a quarter of the cost.
constexpr int kFactor = 2;

// NEC of the same rig turned off its place: what the footage gives where nothing is aligned.
struct Baseline {
    double mean, deviation;
};

Baseline displaced(const Level& level, const Rig& rig, int num_threads) {
    constexpr int kDirections = 8;
    const double width = rig.reference.width_by_focal();  // about an angle
    std::vector<double> values;
    for (double radius : {0.04, 0.07, 0.10})
        for (int i = 0; i < kDirections; ++i) {
            const double angle = 2 * kPi * i / kDirections;
            const Eigen::Vector3d turn(std::sin(angle), std::cos(angle), 0);
            values.push_back(
                pooled(level, turn_source(rig, radius * width * turn), num_threads).nec);
        }
    Baseline out{0, 0};
    for (double v : values) out.mean += v / static_cast<double>(values.size());
    for (double v : values)
        out.deviation += (v - out.mean) * (v - out.mean) / static_cast<double>(values.size() - 1);
    out.deviation = std::sqrt(out.deviation);
    return out;
}

}  // namespace

void judge(const WorkingImages& images, const Rig& rig, const Plan& plan,
           CalibrationReport& report) {
    constexpr double kDetail = 0.5, kContrast = 5.0, kRepeatability = 1.0, kShift = 3.0,
                     kShare = 0.05;
    const int num_threads = plan.options.num_threads;
    const Level level = make_level(images, kFactor, rig, num_threads);
    const double here = pooled(level, rig, num_threads).nec;
    const Baseline baseline = displaced(level, rig, num_threads);
    report.baseline_nec = baseline.mean;
    report.contrast = baseline.deviation > 0 ? (here - baseline.mean) / baseline.deviation : 0.0;

    const std::size_t pairs = images.size();
    report.repeatability_px = INFINITY;
    if (pairs >= 2) {
        Plan quick = plan;  // they start where all frames agree
        quick.options.max_iterations = std::min(plan.options.max_iterations, 12);
        Rig halves[2] = {rig, rig};
        for (std::size_t k = 0; k < 2; ++k)
            solve_level(fold_of(level, 2, k, true), {}, 2, share_limit(report.valid_share), 1e-5,
                        quick, rig, halves[k]);
        report.repeatability_px = median_distance(level, halves[0], halves[1]);
    }

    report.visible_shift_px = visible_shift(images, rig, num_threads);

    // Where the fit is some pixels off, coarse edges still meet and fine ones do not.
    const double coarse =
        pooled(make_nec_level(images, kCoarse, rig, num_threads), rig, num_threads).aligned;
    const double fine = report.levels.back().aligned;

    report.converged = false;
    if (pairs < 2) report.message = "1 image pair is too few to trust, expected at least 2";
    else if (report.valid_share < kShare)
        report.message = format(
            "the source covers %.0f %% of the reference's edges, expected at "
            "least %.0f %%",
            100 * report.valid_share, 100 * kShare);
    else if (report.contrast < kContrast)
        report.message = format(
            "edges agree hardly better than displaced ones: NEC stands out by "
            "%.1f deviations, expected at least %.0f",
            report.contrast, kContrast);
    else if (fine < kDetail * coarse)
        report.message = format(
            "only coarse edges agree: beyond chance %.3f at 1/%d of the size and %.3f at full "
            "size, "
            "expected at least %.3f",
            coarse, kCoarse, fine, kDetail * coarse);
    else if (report.repeatability_px > kRepeatability)
        report.message = format(
            "two halves of the frames disagree by %.2f px, expected at most "
            "%.1f",
            report.repeatability_px, kRepeatability);
    else if (report.visible_shift_px > kShift)
        report.message = format(
            "flow between the registered images still sees a shift of %.1f px, expected at most "
            "%.0f",
            report.visible_shift_px, kShift);
    else {
        report.converged = true;
        report.message = format(
            "NEC stands out by %.1f deviations, two halves of the frames agree "
            "to %.2f px",
            report.contrast, report.repeatability_px);
    }
}

}  // namespace xcalib

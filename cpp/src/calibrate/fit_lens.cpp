#include "calibrate/fit_lens.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "solve/solve.hpp"

namespace xcalib {
namespace {

// What frames gain from one rig to another, each by its NEC.
void add_gains(const Level& unseen, const Rig& from, const Rig& to, std::vector<double>& gains) {
    const Rig before = unseen.rig_at(from), after = unseen.rig_at(to);
    for (const auto& pair : unseen.pairs)
        gains.push_back(pair->evaluate(after).nec - pair->evaluate(before).nec);
}

}  // namespace

LensReport fit_lens(const Level& level, double share_limit, double tolerance, const Plan& plan,
                    Rig& rig) {
    // Gains as small as that no lens is needed for; and so many of their own deviations.
    constexpr double kGain = 1e-3, kDeviations = 3.0;
    constexpr std::size_t kPairs = 4;  // fewer show no deviation
    constexpr double kHalfTolerance = 1e-4;
    LensReport report;
    if (level.pairs.size() < kPairs) return report;
    report.tried = true;
    Plan bent = plan;
    bent.frees_lens = true;
    const int num_threads = plan.options.num_threads;
    Rig lens = rig;
    if (rig.source.lens.bends()) {
        rig.source.lens = Lens();
        solve_level(level, {}, 2, share_limit, tolerance, plan, rig, rig);
    } else {
        solve_level(level, {}, 2, share_limit, tolerance, bent, rig, lens);
    }
    const double straight_nec = pooled(level, rig, num_threads).nec;
    const double bent_nec = pooled(level, lens, num_threads).nec;
    report.k1 = lens.source.lens.coefficient(0);
    report.k2 = lens.source.lens.coefficient(1);
    report.gain = bent_nec - straight_nec;
    if (report.gain < kGain) return report;

    std::vector<double> gains;
    for (std::size_t k = 0; k < 2; ++k) {
        const Level seen = half_of(level, k), unseen = half_of(level, 1 - k);
        Rig without = rig, with = lens;
        solve_level(seen, {}, 2, share_limit, kHalfTolerance, plan, without, without);
        solve_level(seen, {}, 2, share_limit, kHalfTolerance, bent, with, with);
        add_gains(unseen, without, with, gains);
    }
    const double count = static_cast<double>(gains.size());
    double mean = 0, squares = 0;
    for (const double gain : gains) mean += gain / count;
    for (const double gain : gains) squares += (gain - mean) * (gain - mean);
    report.gain = mean;
    report.gain_deviation = std::sqrt(squares / (count - 1) / count);
    report.kept = mean > kGain && mean > kDeviations * report.gain_deviation;
    if (report.kept) rig = lens;
    return report;
}

}  // namespace xcalib

#include "calibrate/fit_lens.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "solve/solve.hpp"

namespace xcalib {
namespace {

// Smaller gains in NEC are not worth a lens; nor are those of fewer of their own deviations.
constexpr double kGain = 1e-3, kDeviations = 3.0;
constexpr std::size_t kPairs = 4;  // fewer show no deviation

struct Gain {
    double mean, deviation;  // of the mean
    bool counts() const { return mean > kGain && mean > kDeviations * deviation; }
};

// The pairs of a level that are in a fold, or in none but it.
Level fold_of(const Level& level, std::size_t folds, std::size_t fold, bool inside) {
    return part_of(level, [&](std::size_t i) { return (i % folds == fold) == inside; });
}

// What frames gain from `simple` to `rich`, each by fits to other frames that begin there.
Gain unseen_gain(const Level& level, double share_limit, const Plan& simple_plan,
                 const Plan& rich_plan, const Rig& simple, const Rig& rich) {
    constexpr double kTolerance = 1e-4;
    // A fit to half of few frames is poor, whatever the lens.
    const std::size_t pairs = level.pairs.size();
    const std::size_t folds = std::min(std::max<std::size_t>(32 / pairs, 2), pairs);
    std::vector<double> gains;
    for (std::size_t k = 0; k < folds; ++k) {
        const Level seen = fold_of(level, folds, k, false), unseen = fold_of(level, folds, k, true);
        Rig before = simple, after = rich;
        solve_level(seen, {}, 2, share_limit, kTolerance, simple_plan, simple, before);
        solve_level(seen, {}, 2, share_limit, kTolerance, rich_plan, rich, after);
        before = unseen.rig_at(before), after = unseen.rig_at(after);
        for (const auto& pair : unseen.pairs)
            gains.push_back(pair->evaluate(after).nec - pair->evaluate(before).nec);
    }
    const double count = static_cast<double>(gains.size());
    double mean = 0, squares = 0;
    for (const double gain : gains) mean += gain / count;
    for (const double gain : gains) squares += (gain - mean) * (gain - mean);
    return {mean, std::sqrt(squares / (count - 1) / count)};
}

}  // namespace

LensReport fit_lens(const Level& level, double share_limit, double tolerance, const Plan& plan,
                    Rig& rig) {
    LensReport report;
    if (level.pairs.size() < kPairs) return report;
    report.tried = true;
    const int num_threads = plan.options.num_threads;

    // By how many coefficients they have; each is worth looking at where all frames gain.
    std::vector<Rig> fits;
    std::vector<Plan> plans;
    std::vector<double> necs;
    const auto solve = [&](int coefficients, const Rig& from) {
        plans.push_back(plan);
        plans.back().lens_coefficients = coefficients;
        fits.push_back(from);
        if (coefficients == 0) fits[0].source.lens = Lens();
        // It was solved as it came.
        if (coefficients != (rig.source.lens.bends() ? 1 : 0))
            solve_level(level, {}, 2, share_limit, tolerance, plans.back(), fits.back(),
                        fits.back());
        necs.push_back(pooled(level, fits.back(), num_threads).nec);
    };
    solve(0, rig);
    solve(1, rig);
    report.gain = necs[1] - necs[0];
    if (report.gain > kGain) solve(2, fits[1]);
    while (fits.size() > 1 && necs.back() - necs[fits.size() - 2] <= kGain) {
        fits.pop_back();
        necs.pop_back();
    }
    while (fits.size() > 1) {
        const Gain gain = unseen_gain(level, share_limit, plans[fits.size() - 2],
                                      plans[fits.size() - 1], fits[fits.size() - 2], fits.back());
        report.gain = gain.mean;
        report.gain_deviation = gain.deviation;
        if (gain.counts()) break;
        fits.pop_back();
    }
    rig = fits.back();
    report.coefficients = static_cast<int>(fits.size()) - 1;
    return report;
}

}  // namespace xcalib

#include "calibrate/fit_lens.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "solve/solve.hpp"

namespace xcalib {
namespace {

// Smaller gains in NEC are not worth a lens; nor are those of fewer of their own deviations.
constexpr double kGain = 1e-3, kDeviations = 3.0;
constexpr std::size_t kLeastPairs = 4;  // fewer show no deviation

struct Gain {
    double mean, deviation;  // of the mean
    bool counts() const { return mean > kGain && mean > kDeviations * deviation; }
};

// With so many coefficients as its plan frees, solved on all frames.
struct Fit {
    Plan plan;
    Rig rig;
    double nec;
};

// What frames gain from `simple` to `rich`, each by fits to other frames that begin there.
Gain unseen_gain(const Level& level, double share_limit, const Fit& simple, const Fit& rich) {
    constexpr double kTolerance = 1e-4;
    // A fit to half of few frames is poor, whatever the lens.
    const std::size_t pairs = level.pairs.size();
    const std::size_t folds = std::min(std::max<std::size_t>(32 / pairs, 2), pairs);
    std::vector<double> gains;
    for (std::size_t k = 0; k < folds; ++k) {
        const Level seen = fold_of(level, folds, k, false), unseen = fold_of(level, folds, k, true);
        Rig before = simple.rig, after = rich.rig;
        solve_level(seen, {}, 2, share_limit, kTolerance, simple.plan, before, before);
        solve_level(seen, {}, 2, share_limit, kTolerance, rich.plan, after, after);
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
    const int num_threads = plan.options.num_threads;
    if (plan.options.optimize_lens) {
        Plan free = plan;
        free.lens_coefficients = 2;
        const double before = pooled(level, rig, num_threads).nec;
        solve_level(level, {}, 2, share_limit, tolerance, free, rig, rig);
        report.tried = true;
        report.coefficients = 2;
        report.gain = pooled(level, rig, num_threads).nec - before;
        return report;
    }
    if (level.pairs.size() < kLeastPairs) return report;
    report.tried = true;

    // By how many coefficients they have; each is worth looking at where all frames gain.
    std::vector<Fit> fits;
    const auto solve = [&](int coefficients, const Rig& from) {
        Fit fit{plan, from, 0};
        fit.plan.lens_coefficients = coefficients;
        if (coefficients == 0) fit.rig.source.lens = Lens();
        // It was solved as it came.
        if (coefficients != (rig.source.lens.bends() ? 1 : 0))
            solve_level(level, {}, 2, share_limit, tolerance, fit.plan, fit.rig, fit.rig);
        fit.nec = pooled(level, fit.rig, num_threads).nec;
        fits.push_back(fit);
    };
    solve(0, rig);
    solve(1, rig);
    report.gain = fits[1].nec - fits[0].nec;
    if (report.gain > kGain) solve(2, fits[1].rig);
    while (fits.size() > 1 && fits.back().nec - fits[fits.size() - 2].nec <= kGain) fits.pop_back();
    while (fits.size() > 1) {
        const Gain gain = unseen_gain(level, share_limit, fits[fits.size() - 2], fits.back());
        report.gain = gain.mean;
        report.gain_deviation = gain.deviation;
        if (gain.counts()) break;
        fits.pop_back();
    }
    rig = fits.back().rig;
    report.coefficients = static_cast<int>(fits.size()) - 1;
    return report;
}

}  // namespace xcalib

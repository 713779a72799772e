#include "xcalib/footage/lags.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <stdexcept>

#include "base/format.hpp"
#include "base/parallel.hpp"
#include "base/workers.hpp"
#include "footage/source_trials.hpp"

namespace xcalib {
namespace {

constexpr int kCoarsest = 4, kMiddle = 2, kFinest = 1;  // levels
constexpr double kDeviations = 3.0;                     // of the mean difference that decide
constexpr double kMinGain = 0.002;                      // difference of the NEC that decides
constexpr double kHopeless = 5.0;         // deviations at which a lag is looked at no more
constexpr std::size_t kEvery = SIZE_MAX;  // lags that are refitted

// What is fitted at one lag.
struct Lagged {
    int lag = 0;
    Trial trial;
    Difference gain;  // over lag 0 at that level
};

std::size_t own_of(const std::vector<Lagged>& lags) {
    std::size_t own = 0;
    while (lags[own].lag != 0) ++own;
    return own;
}

// Beside lag 0, all at one level.
void compare(std::vector<Lagged>& lags) {
    const Lagged own = lags[own_of(lags)];
    for (Lagged& lag : lags)
        if (lag.lag != 0) lag.gain = difference(lag.trial.nec, own.trial.nec);
}

// The lag of the highest mean NEC, by the gains over lag 0.
const Lagged& best_of(const std::vector<Lagged>& lags) {
    return *std::max_element(lags.begin(), lags.end(), [](const Lagged& a, const Lagged& b) {
        return a.gain.mean < b.gain.mean;
    });
}

// The lag at which the later half of the footage fits better, and the first half worse, or the
// other way round; 0 where there is none.
int change_of(const std::vector<Lagged>& lags) {
    const Lagged& own = lags[own_of(lags)];
    const std::vector<double>& with_own = own.trial.nec;
    const std::size_t half = with_own.size() / 2;
    for (const Lagged& lag : lags) {
        if (difference(with_own, lag.trial.nec, 0, half).decides(kDeviations, kMinGain) &&
            difference(lag.trial.nec, with_own, half).decides(kDeviations, kMinGain))
            return lag.lag;
        if (difference(lag.trial.nec, with_own, 0, half).decides(kDeviations, kMinGain) &&
            difference(with_own, lag.trial.nec, half).decides(kDeviations, kMinGain))
            return -lag.lag;
    }
    return 0;
}

// Without the lags that have fallen behind the best, and at most `count` of them; lag 0 stays.
std::vector<Lagged> hopeful(const std::vector<Lagged>& lags, std::size_t count) {
    const Lagged& best = best_of(lags);
    std::vector<Lagged> kept;
    for (const Lagged& lag : lags)
        if (lag.lag == 0 || lag.lag == best.lag ||
            (count > 2 && !difference(best.trial.nec, lag.trial.nec).decides(kHopeless, kMinGain)))
            kept.push_back(lag);
    return kept;
}

// What is reported of it, in the images as they were given.
LagFit fit_of(const Lagged& lag, const SourceTrials& trials) {
    const Trial& trial = lag.trial;
    LagFit fit;
    fit.lag = lag.lag;
    fit.frames = static_cast<int>(trial.frames.size());
    fit.factor = trial.factor;
    for (const std::size_t i : trial.frames) fit.nec += trial.nec[i] / fit.frames;
    fit.gain = lag.gain.mean;
    fit.error = lag.lag == 0 ? 0.0 : lag.gain.error;
    fit.rig = trials.given(trial.rig);
    return fit;
}

int count_of(const SourcesAtLag& at) {
    int count = 0;
    for (const ImageView& source : at.sources) count += source.data != nullptr;
    return count;
}

void validate(const std::vector<ImageView>& references, const std::vector<SourcesAtLag>& lags) {
    const SourcesAtLag* own = nullptr;
    for (std::size_t k = 0; k < lags.size(); ++k) {
        if (k > 0 && lags[k].lag <= lags[k - 1].lag)
            throw std::invalid_argument("lags do not rise, expected each once, rising");
        if (lags[k].sources.size() != references.size())
            throw std::invalid_argument(
                format("lag %d has %zu sources, expected one for each of %zu references",
                       lags[k].lag, lags[k].sources.size(), references.size()));
        if (lags[k].lag == 0) own = &lags[k];
    }
    if (!own)
        throw std::invalid_argument("there is no lag 0, expected the references' own sources");
    for (const SourcesAtLag& at : lags)
        for (const ImageView& source : at.sources)
            if (source.data &&
                (source.width != own->sources[0].width || source.height != own->sources[0].height))
                throw std::invalid_argument(format("a source at lag %d is %dx%d, expected %dx%d",
                                                   at.lag, source.width, source.height,
                                                   own->sources[0].width, own->sources[0].height));
}

}  // namespace

LagReport fit_lags(const std::vector<ImageView>& references, const std::vector<ImageView>& depths,
                   const std::vector<SourcesAtLag>& sources_at, const Rig& rig,
                   const CalibrationOptions& options) {
    validate(references, sources_at);
    const WorkersOfThread workers(resolve_threads(options.num_threads));
    const auto own_sources = std::find_if(sources_at.begin(), sources_at.end(),
                                          [](const SourcesAtLag& at) { return at.lag == 0; });
    const SourceTrials trials(references, own_sources->sources, depths, rig, options);
    const Rig& found = trials.rig();

    // Outwards from lag 0, as long as there is hope: what moves evenly takes the next lag on from
    // the last one.
    std::vector<Lagged> lags = {{0, trials.start(), {}}};
    trials.refit(kCoarsest, {found}, lags[0].trial);
    for (const int way : {-1, 1}) {
        Rig last = lags[own_of(lags)].trial.rig;
        for (auto at = own_sources;;) {
            if (way < 0 ? at == sources_at.begin() : at + 1 == sources_at.end()) break;
            at += way;
            if (count_of(*at) < kMinLagFrames) break;
            Lagged next{at->lag, trials.start(at->sources), {}};
            trials.refit(kCoarsest, {found, last}, next.trial);
            last = next.trial.rig;
            const bool hopeless = difference(lags[own_of(lags)].trial.nec, next.trial.nec)
                                      .decides(kHopeless, kMinGain);
            lags.push_back(std::move(next));
            if (hopeless) break;
        }
    }
    std::sort(lags.begin(), lags.end(),
              [](const Lagged& a, const Lagged& b) { return a.lag < b.lag; });

    compare(lags);

    LagReport report;
    std::map<int, LagFit> fits;
    for (const int factor : {kCoarsest, kMiddle, kFinest}) {
        if (factor != kCoarsest) {
            // What half the size shows clearly needs no finer look.
            if (factor == kFinest && best_of(lags).gain.decides(kHopeless, kMinGain)) break;
            lags = hopeful(lags, factor == kFinest ? 2 : kEvery);
            if (lags.size() == 1) break;
            // Each from the rig of any: where nothing moves, one lag must not win by a better
            // start.
            std::vector<Rig> rigs;
            for (const Lagged& lag : lags) rigs.push_back(lag.trial.rig);
            for (Lagged& lag : lags) {
                std::vector<Rig> starts = {lag.trial.rig};
                starts.insert(starts.end(), rigs.begin(), rigs.end());
                trials.refit(factor, starts, lag.trial);
            }
            compare(lags);
            report.change = change_of(lags);
        }
        for (const Lagged& lag : lags) fits[lag.lag] = fit_of(lag, trials);
        if (report.change != 0) break;
    }
    for (const auto& [lag, fit] : fits) report.fits.push_back(fit);
    if (report.change == 0 && best_of(lags).gain.decides(kDeviations, kMinGain))
        report.frames = best_of(lags).lag;
    return report;
}

}  // namespace xcalib

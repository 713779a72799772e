#include "xcalib/footage/lags.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <stdexcept>

#include "base/format.hpp"
#include "base/parallel.hpp"
#include "calibrate/find_mounts.hpp"
#include "calibrate/relative_depth.hpp"
#include "solve/solve.hpp"

namespace xcalib {
namespace {

constexpr int kCoarsest = 4, kMiddle = 2, kFinest = 1;  // levels
constexpr int kIterations = 8;                          // of a refit at a level
constexpr double kDeviations = 3.0;                     // of the mean difference that decide
constexpr double kMinGain = 0.002;                      // difference of the NEC that decides
constexpr double kHopeless = 5.0;         // deviations at which a lag is looked at no more
constexpr std::size_t kEvery = SIZE_MAX;  // lags that are refitted

struct Difference {
    double mean = 0.0, error = INFINITY;
    int frames = 0;
    // Whether it is above 0, and not by chance.
    bool decides(double deviations, double least) const {
        return mean > std::max(deviations * error, least);
    }
};

// What is fitted at one lag.
struct Lagged {
    int lag = 0;
    std::vector<std::size_t> frames;  // of the references
    std::shared_ptr<const WorkingImages> images;
    Rig rig;
    std::vector<double> nec;  // of each reference; NaN where there is no source
    int factor = 0;           // of the level that these belong to
    Difference gain;          // over lag 0 at that level
};

// NEC of `a` above `b`, over the references that have both.
Difference difference(const Lagged& a, const Lagged& b, std::size_t begin = 0,
                      std::size_t end = kEvery) {
    std::vector<double> values;
    for (std::size_t i = begin; i < std::min(a.nec.size(), end); ++i)
        if (std::isfinite(a.nec[i] - b.nec[i])) values.push_back(a.nec[i] - b.nec[i]);
    Difference out;
    out.frames = static_cast<int>(values.size());
    if (values.size() < 2) return out;
    const auto count = static_cast<double>(values.size());
    for (const double value : values) out.mean += value / count;
    double squares = 0;
    for (const double value : values) squares += (value - out.mean) * (value - out.mean);
    out.error = std::sqrt(squares / (count - 1) / count);
    return out;
}

// Refits at a level, from the better of the rigs `starts`, and takes the NEC of every frame.
void refit(int factor, const std::vector<Rig>& starts, const Plan& plan, Lagged& at) {
    const int num_threads = plan.options.num_threads;
    const Level level = make_level(*at.images, factor, starts[0], num_threads);
    at.rig = starts[0];
    NecValue best = pooled(level, at.rig, num_threads);
    for (std::size_t k = 1; k < starts.size(); ++k) {
        const NecValue value = pooled(level, starts[k], num_threads);
        if (value.nec <= best.nec) continue;
        best = value;
        at.rig = starts[k];
    }
    solve_level(level, {}, 2, share_limit(best.valid_share), 1e-5, plan, at.rig, at.rig);
    const Rig at_level = level.rig_at(at.rig);
    std::vector<double> values(level.pairs.size());
    parallel_each(static_cast<int>(values.size()), num_threads,
                  [&](int i) { values[i] = level.pairs[i]->evaluate(at_level).nec; });
    at.factor = factor;
    at.nec.assign(at.nec.size(), std::numeric_limits<double>::quiet_NaN());
    for (std::size_t i = 0; i < values.size(); ++i) at.nec[at.frames[i]] = values[i];
}

std::size_t own_of(const std::vector<Lagged>& lags) {
    std::size_t own = 0;
    while (lags[own].lag != 0) ++own;
    return own;
}

// Beside lag 0, all at one level.
void compare(std::vector<Lagged>& lags) {
    const Lagged own = lags[own_of(lags)];
    for (Lagged& lag : lags)
        if (lag.lag != 0) lag.gain = difference(lag, own);
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
    const std::size_t half = own.nec.size() / 2;
    for (const Lagged& lag : lags) {
        if (difference(own, lag, 0, half).decides(kDeviations, kMinGain) &&
            difference(lag, own, half).decides(kDeviations, kMinGain))
            return lag.lag;
        if (difference(lag, own, 0, half).decides(kDeviations, kMinGain) &&
            difference(own, lag, half).decides(kDeviations, kMinGain))
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
            (count > 2 && !difference(best, lag).decides(kHopeless, kMinGain)))
            kept.push_back(lag);
    return kept;
}

// What is reported of it, in the images as they were given.
LagFit fit_of(const Lagged& lag, bool mirrored) {
    LagFit fit;
    fit.lag = lag.lag;
    fit.frames = static_cast<int>(lag.frames.size());
    fit.factor = lag.factor;
    for (const std::size_t i : lag.frames) fit.nec += lag.nec[i] / fit.frames;
    fit.gain = lag.gain.mean;
    fit.error = lag.lag == 0 ? 0.0 : lag.gain.error;
    fit.rig = mirrored ? with_flipped_source(lag.rig) : lag.rig;
    return fit;
}

int count_of(const SourcesAtLag& at) {
    int count = 0;
    for (const ImageView& source : at.sources) count += source.data != nullptr;
    return count;
}

void validate(const std::vector<ImageView>& references, const std::vector<ImageView>& depths,
              const std::vector<SourcesAtLag>& lags) {
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
    validate_frames(references, own->sources, depths);
    for (const SourcesAtLag& at : lags)
        for (const ImageView& source : at.sources)
            if (source.data &&
                (source.width != own->sources[0].width || source.height != own->sources[0].height))
                throw std::invalid_argument(format("a source at lag %d is %dx%d, expected %dx%d",
                                                   at.lag, source.width, source.height,
                                                   own->sources[0].width, own->sources[0].height));
}

// The options of the fit, as it is seen from within: images are not mirrored there.
Plan plan_of(const CalibrationOptions& options, bool mirrored) {
    Plan plan(options);
    plan.options.max_iterations = std::min(options.max_iterations, kIterations);
    if (mirrored && options.source_camera)
        plan.options.source_camera = options.source_camera->flipped();
    return plan;
}

}  // namespace

LagReport fit_lags(const std::vector<ImageView>& references, const std::vector<ImageView>& depths,
                   const std::vector<SourcesAtLag>& sources_at, const Rig& rig,
                   const CalibrationOptions& options) {
    validate(references, depths, sources_at);
    const WorkersOfThread workers(resolve_threads(options.num_threads));
    const Plan plan = plan_of(options, rig.source_mirrored);
    const Rig found = rig.source_mirrored ? with_flipped_source(rig) : rig;
    std::vector<int> every(references.size());
    for (std::size_t i = 0; i < every.size(); ++i) every[i] = static_cast<int>(i);
    const auto own_sources = std::find_if(sources_at.begin(), sources_at.end(),
                                          [](const SourcesAtLag& at) { return at.lag == 0; });
    WorkingImages images =
        make_working_images(references, own_sources->sources, depths, every, plan);
    if (rig.relative_depth && options.relative_depth)
        images =
            with_shifted_depth(images, rig.relative_depth->shift - options.relative_depth->shift);

    const auto start_at = [&](const SourcesAtLag& at) {
        Lagged lagged;
        lagged.lag = at.lag;
        lagged.nec.resize(references.size());
        std::vector<ImageView> views;
        for (std::size_t i = 0; i < at.sources.size(); ++i) {
            if (!at.sources[i].data) continue;
            lagged.frames.push_back(i);
            views.push_back(at.sources[i]);
        }
        WorkingImages own = images.subset(lagged.frames);
        if (at.lag != 0) own = with_sources(std::move(own), views, options.num_threads);
        if (rig.source_mirrored) own = with_mirrored_sources(own);
        lagged.images = std::make_shared<const WorkingImages>(std::move(own));
        return lagged;
    };

    // Outwards from lag 0, as long as there is hope: what moves evenly takes the next lag on from
    // the last one.
    std::vector<Lagged> lags = {start_at(*own_sources)};
    refit(kCoarsest, {found}, plan, lags[0]);
    for (const int way : {-1, 1}) {
        Rig last = lags[own_of(lags)].rig;
        for (auto at = own_sources;;) {
            if (way < 0 ? at == sources_at.begin() : at + 1 == sources_at.end()) break;
            at += way;
            if (count_of(*at) < kMinLagFrames) break;
            Lagged next = start_at(*at);
            refit(kCoarsest, {found, last}, plan, next);
            last = next.rig;
            const bool hopeless = difference(lags[own_of(lags)], next).decides(kHopeless, kMinGain);
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
            for (const Lagged& lag : lags) rigs.push_back(lag.rig);
            for (Lagged& lag : lags) {
                std::vector<Rig> starts = {lag.rig};
                starts.insert(starts.end(), rigs.begin(), rigs.end());
                refit(factor, starts, plan, lag);
            }
            compare(lags);
            report.change = change_of(lags);
        }
        for (const Lagged& lag : lags) fits[lag.lag] = fit_of(lag, rig.source_mirrored);
        if (report.change != 0) break;
    }
    for (const auto& [lag, fit] : fits) report.fits.push_back(fit);
    if (report.change == 0 && best_of(lags).gain.decides(kDeviations, kMinGain))
        report.frames = best_of(lags).lag;
    return report;
}

}  // namespace xcalib

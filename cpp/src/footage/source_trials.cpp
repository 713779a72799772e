#include "footage/source_trials.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/parallel.hpp"
#include "calibrate/find_mounts.hpp"
#include "calibrate/relative_depth.hpp"
#include "solve/solve.hpp"

namespace xcalib {
namespace {

constexpr int kIterations = 8;  // of a refit at a level

// The options of the fit, as it is seen from within: images are not mirrored there.
Plan plan_of(const CalibrationOptions& options, bool mirrored) {
    Plan plan(options);
    plan.options.max_iterations = std::min(options.max_iterations, kIterations);
    if (mirrored && options.source_camera)
        plan.options.source_camera = options.source_camera->flipped();
    return plan;
}

}  // namespace

Difference difference(const std::vector<double>& a, const std::vector<double>& b, std::size_t begin,
                      std::size_t end) {
    std::vector<double> values;
    for (std::size_t i = begin; i < std::min(a.size(), end); ++i)
        if (std::isfinite(a[i] - b[i])) values.push_back(a[i] - b[i]);
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

SourceTrials::SourceTrials(const std::vector<ImageView>& references,
                           const std::vector<ImageView>& own, const std::vector<ImageView>& depths,
                           const Rig& rig, const CalibrationOptions& options)
    : plan_(plan_of(options, rig.source_mirrored)), mirrored_(rig.source_mirrored),
      rig_(given(rig)) {
    validate_frames(references, own, depths);
    std::vector<int> every(references.size());
    std::iota(every.begin(), every.end(), 0);
    images_ = make_working_images(references, own, depths, every, plan_);
    if (rig.relative_depth && options.relative_depth)
        images_ =
            with_shifted_depth(images_, rig.relative_depth->shift - options.relative_depth->shift);
}

Rig SourceTrials::given(const Rig& rig) const { return mirrored_ ? with_flipped_source(rig) : rig; }

Trial SourceTrials::with(WorkingImages images, std::vector<std::size_t> frames) const {
    Trial trial;
    trial.nec.resize(images_.size());
    trial.frames = std::move(frames);
    if (mirrored_) images = with_mirrored_sources(images);
    trial.images = std::make_shared<const WorkingImages>(std::move(images));
    return trial;
}

Trial SourceTrials::start() const {
    std::vector<std::size_t> every(images_.size());
    std::iota(every.begin(), every.end(), 0);
    return with(images_, std::move(every));
}

Trial SourceTrials::start(const std::vector<ImageView>& sources) const {
    std::vector<std::size_t> frames;
    std::vector<ImageView> views;
    for (std::size_t i = 0; i < sources.size(); ++i) {
        if (!sources[i].data) continue;
        frames.push_back(i);
        views.push_back(sources[i]);
    }
    return with(with_sources(images_.subset(frames), views, plan_.options.num_threads), frames);
}

void SourceTrials::refit(int factor, const std::vector<Rig>& starts, Trial& trial) const {
    const int num_threads = plan_.options.num_threads;
    const Level level = make_level(*trial.images, factor, starts[0], num_threads);
    trial.rig = starts[0];
    NecValue best = pooled(level, trial.rig, num_threads);
    for (std::size_t k = 1; k < starts.size(); ++k) {
        const NecValue value = pooled(level, starts[k], num_threads);
        if (value.nec <= best.nec) continue;
        best = value;
        trial.rig = starts[k];
    }
    solve_level(level, {}, 2, share_limit(best.valid_share), 1e-5, plan_, trial.rig, trial.rig);
    const Rig at_level = level.rig_at(trial.rig);
    std::vector<double> values(level.pairs.size());
    parallel_each(static_cast<int>(values.size()), num_threads,
                  [&](int i) { values[i] = level.pairs[i]->evaluate(at_level).nec; });
    trial.factor = factor;
    trial.nec.assign(trial.nec.size(), std::numeric_limits<double>::quiet_NaN());
    for (std::size_t i = 0; i < values.size(); ++i) trial.nec[trial.frames[i]] = values[i];
}

}  // namespace xcalib

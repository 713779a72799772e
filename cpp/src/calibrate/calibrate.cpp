#include "xcalib/calibrate.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <sstream>
#include <stdexcept>

#include "base/format.hpp"
#include "base/parallel.hpp"
#include "calibrate/adam.hpp"
#include "calibrate/find_mounts.hpp"
#include "calibrate/fit_lens.hpp"
#include "calibrate/halves.hpp"
#include "calibrate/relative_depth.hpp"
#include "calibrate/start.hpp"
#include "calibrate/static_edges.hpp"
#include "calibrate/study.hpp"
#include "calibrate/verdict.hpp"
#include "solve/solve.hpp"
#include "solve/working_images.hpp"
#include "xcalib/draw_frames.hpp"

namespace xcalib {
namespace {

void require_size(const char* name, const std::optional<Pinhole>& camera, const ImageView& image) {
    if (!camera || (camera->width == image.width && camera->height == image.height)) return;
    std::ostringstream message;
    message << name << " is " << camera->width << "x" << camera->height << ", expected the images' "
            << image.width << "x" << image.height;
    throw std::invalid_argument(message.str());
}

// What is to be calibrated, checked.
void validate(const std::vector<ImageView>& references, const std::vector<ImageView>& sources,
              const std::vector<ImageView>& depths, const std::optional<Rig>& initial,
              const CalibrationOptions& options) {
    validate_frames(references, sources, depths);
    require_size("options: reference_camera", options.reference_camera, references[0]);
    require_size("options: source_camera", options.source_camera, sources[0]);
    if (initial) {
        initial->validate();
        require_size("initial rig: reference", initial->reference, references[0]);
        require_size("initial rig: source", initial->source, sources[0]);
    } else if (options.search.mode == SearchMode::local) {
        throw std::invalid_argument(
            "options: search.mode = local, expected an initial rig with it");
    }
}

// Levenberg-Marquardt on all frames, from the level at which the start was found on some of them. A
// lens that is kept on the way moves from there on. Returns the finest level.
Level refine(const WorkingImages& images, const Start& found, Plan& plan, const Progress& notify,
             CalibrationResult& result) {
    CalibrationReport& report = result.report;
    const int num_threads = plan.options.num_threads;
    report.candidates = found.candidates;
    report.levels = found.levels;
    result.rig = found.rig;

    const int from = plan.from_coarsest ? kFactors[0] : found.levels.back().factor;
    double limit = 0;
    // The middle levels decide; what the coarse one leaves they find, and at the finest a step
    // costs most.
    const auto tolerance = [](int factor) { return factor == 2 ? 1e-6 : 1e-5; };
    const std::vector<Step> steps =
        schedule(report.working_width, report.working_height, plan.parts);
    Level level;
    for (std::size_t s = 0; s < steps.size(); ++s) {
        if (steps[s].stage == 1 || steps[s].factor > from) continue;
        level = make_level(images, steps[s].factor, result.rig, num_threads);
        if (limit == 0) limit = share_limit(pooled(level, result.rig, num_threads).valid_share);
        report.levels.push_back(solve_stage(images, level, steps[s].stage, limit,
                                            tolerance(steps[s].factor), plan, result.rig));
        // One level is left to solve, if there are so many, with what was found.
        if (plan.estimates_lens && steps[s].factor <= kLensFactor && !report.lens.tried) {
            report.lens = fit_lens(level, limit, tolerance(steps[s].factor), plan, result.rig);
            plan.lens_coefficients = report.lens.coefficients;
        }
        notify("refine",
               0.6 + 0.35 * static_cast<double>(s + 1) / static_cast<double>(steps.size()));
    }
    return level;
}

// The footage, and how it is looked at in one attempt: sources that a mount mirrors are flipped, so
// that nothing within knows of mirrors.
struct Attempt {
    std::shared_ptr<const WorkingImages> images;
    Plan plan;
    std::optional<Rig> initial;

    Attempt(const std::shared_ptr<const WorkingImages>& all, const Plan& base,
            const std::optional<Rig>& given, const Mount& mount)
        : images(all), plan(base), initial(given) {
        plan.mount = mount;
        if (!mount.mirrored) return;
        images = std::make_shared<WorkingImages>(with_mirrored_sources(*all));
        if (plan.options.source_camera)
            plan.options.source_camera = base.options.source_camera->flipped();
        if (plan.options.source_lens)
            plan.options.source_lens = base.options.source_lens->flipped();
        if (given) initial = with_flipped_source(*given);
    }

    // In the images as they were given.
    Rig given(const Rig& rig) const { return plan.mount.mirrored ? with_flipped_source(rig) : rig; }
};

// Estimates the shift of relative depth; images and rig are then those of the shifted depth.
void settle_relative_depth(Attempt& attempt, CalibrationResult& result) {
    const Plan& plan = attempt.plan;
    const double farthest = farthest_inverse_depth(*attempt.images);
    RelativeDepth relative = *plan.options.relative_depth;
    // With another shift goes another source, but for what a lens bends.
    const bool known = plan.options.source_camera || result.rig.source.lens.bends();
    const double shift = known ? best_shift(*attempt.images, plan, farthest, result.rig)
                               : ordinary_shift(result.rig, farthest);
    attempt.images = std::make_shared<WorkingImages>(with_shifted_depth(*attempt.images, shift));
    if (known) {
        const Level level = make_level(*attempt.images, 1, result.rig, plan.options.num_threads);
        result.report.levels.push_back(
            solve_level(level, {}, 2, share_limit(result.report.levels.back().valid_share), 1e-5,
                        plan, result.rig, result.rig));
    } else {
        result.rig = with_shifted_depth(result.rig, shift);
    }
    relative.shift += shift;
    result.rig.relative_depth = relative;
}

// From a rig to a result: what is left once it is solved.
void settle(Attempt& attempt, const Level& finest, const Halves& halves,
            CalibrationResult& result) {
    CalibrationReport& report = result.report;
    report.nec = report.levels.back().nec;
    report.valid_share = report.levels.back().valid_share;
    judge(*attempt.images, finest, result.rig, halves, attempt.plan, report);
    if (attempt.plan.options.relative_depth) settle_relative_depth(attempt, result);
    result.converged = report.converged;
    result.rig = attempt.given(result.rig);
    result.rig.verdict = std::make_shared<const Verdict>(report.verdict);
    const std::string mount = Mount::of(result.rig).text();
    if (mount != Mount{}.text()) report.message += "; the source image is " + mount;
    if (const Lens& lens = result.rig.source.lens; report.lens.coefficients > 0)
        report.message += format("; the source's lens bends: k1 %.3f, k2 %.3f", lens.coefficient(0),
                                 lens.coefficient(1));
    for (CandidateReport& candidate : report.candidates) {
        candidate.found = attempt.given(candidate.found);
        candidate.refined = attempt.given(candidate.refined);
    }
}

// The same where nothing was searched.
void settle_refit(Attempt& attempt, const Level& finest, CalibrationResult& result) {
    settle(attempt, finest,
           refit_halves(*attempt.images, result.rig, attempt.plan,
                        result.report.levels.back().valid_share),
           result);
}

// Two calibrations, each of half of the frames, and from the better of them one of all. Returns how
// well edges agree at its start.
double fit(Attempt& attempt, const ImageView& reference, const ImageView& source,
           const Progress& notify, double& search_seconds, CalibrationResult& result) {
    Plan& plan = attempt.plan;
    const WorkingImages& images = *attempt.images;
    const auto searching = [&](double share) { notify("search", 0.05 + 0.55 * share); };
    if (!plan.searches) {  // there is nothing that two halves could find apart
        const Start start = find_start(images, reference, source, attempt.initial, plan, searching);
        search_seconds += start.search_seconds;
        const Level finest = refine(images, start, plan, notify, result);
        settle_refit(attempt, finest, result);
        return start.merit;
    }
    const Halves halves = fit_halves(images, reference, source, attempt.initial, plan, searching);
    std::optional<Start> start = halves.start;
    // Where they disagree, half of the frames may have been too few.
    if (!agree(halves, images)) {
        Start whole = find_start(images, reference, source, attempt.initial, plan, [](double) {});
        if (!start || merit_on(images, whole.rig, plan) > merit_on(images, start->rig, plan))
            start = std::move(whole);
    }
    search_seconds += start->search_seconds;
    const Level finest = refine(images, *start, plan, notify, result);
    settle(attempt, finest, halves, result);
    return start->merit;
}

// The best of the mounts that the footage may have, and how it is looked at; none where the edges
// of no other agree clearly better than those of the upright one.
std::optional<Attempt> best_turned(const std::shared_ptr<const WorkingImages>& images,
                                   const ImageView& reference, const ImageView& source,
                                   const Plan& plan, double upright_merit) {
    constexpr std::size_t kMounts = 2;
    constexpr double kClearly = 1.15;
    std::optional<Attempt> best;
    double merit = kClearly * upright_merit;
    for (const Mount& mount : find_mounts(*images, reference, source, plan, kMounts)) {
        Attempt attempt(images, plan, std::nullopt, mount);
        const Start start = find_start(*attempt.images, reference, source, std::nullopt,
                                       attempt.plan, [](double) {});
        if (start.merit <= merit) continue;
        merit = start.merit;
        best = std::move(attempt);
    }
    return best;
}

}  // namespace

CalibrationResult calibrate_parts(const Parts& parts, const std::vector<ImageView>& references,
                                  const std::vector<ImageView>& sources,
                                  const std::vector<ImageView>& depths,
                                  const std::optional<Rig>& initial,
                                  const CalibrationOptions& options, const Progress& progress,
                                  const FlowEstimator& flow) {
    const double start = seconds_now();
    const Progress notify = [&](const std::string& stage, double share) {
        if (progress) progress(stage, share);
    };
    Plan plan(options, flow, parts);
    if (initial) plan.fits_gauge = false;  // it is known, as is a lens that it has
    if (initial && initial->source.lens.bends() && !options.optimize_lens)
        plan.estimates_lens = false;
    validate(references, sources, depths, initial, options);

    const WorkersOfThread workers(resolve_threads(options.num_threads));
    CalibrationResult result;
    result.report.frames =
        draw_frames(static_cast<int>(references.size()), options.max_frames, options.seed);
    notify("prepare", 0.0);
    double still = 0;
    const auto images = std::make_shared<const WorkingImages>(without_static_edges(
        make_working_images(references, sources, depths, result.report.frames, plan), still));
    result.report.working_width = images->references[0].width;
    result.report.working_height = images->references[0].height;

    Mount mount = plan.mount;
    if (initial) mount.mirrored = initial->source_mirrored;
    Attempt attempt(images, plan, initial, mount);
    double search_seconds = 0.0;
    if (options.solver == Solver::adam) {
        notify("refine", 0.05);
        result.rig = given_start(references[0], sources[0], attempt.initial, attempt.plan.options);
        solve_adam(
            *attempt.images, attempt.plan,
            [&](double share) { notify("refine", 0.05 + 0.9 * share); }, result.rig, result.report);
        result.report.lens.tried = options.optimize_lens;
        result.report.lens.coefficients = attempt.plan.lens_coefficients;
        settle_refit(attempt, make_level(*attempt.images, 1, result.rig, options.num_threads),
                     result);
    } else {
        notify("search", 0.05);
        const CalibrationResult empty = result;
        const double upright =
            fit(attempt, references[0], sources[0], notify, search_seconds, result);
        if (!result.report.verdict.found && plan.searches && !initial && !options.mount) {
            notify("mount", 0.96);
            if (auto turned = best_turned(images, references[0], sources[0], plan, upright)) {
                result = empty;
                fit(*turned, references[0], sources[0], notify, search_seconds, result);
            }
        }
    }
    // Of a few frames, some edges lie alike by chance.
    if (still >= 0.03)
        result.report.message += format(
            "; what stands still in the reference (%.1f %% of its edges) is left out", 100 * still);
    if (references[0].channels == 1 && sources[0].channels > 1)
        result.report.message +=
            "; the source is in colour and the reference is not: have they been exchanged?";
    notify("judge", 1.0);
    result.report.seconds = seconds_now() - start;
    result.report.time = images->times->seconds(resolve_threads(options.num_threads));
    result.report.time.search = search_seconds;
    return result;
}

void CalibrationResult::distrust(const std::string& reason, const std::string& advice) {
    if (reason.empty()) return;
    Verdict& verdict = report.verdict;
    const std::string line = reason + (advice.empty() ? "" : "; " + advice);
    // The footage explains what is wrong with the fit, so it comes first.
    const std::string then = verdict.trusted ? "" : "besides: " + verdict.line();
    report.message = verdict.trusted ? line : line + "; besides: " + report.message;
    verdict.reason = reason;
    verdict.advice = advice + (advice.empty() || then.empty() ? "" : "; ") + then;
    verdict.trusted = report.converged = converged = false;
    rig.verdict = std::make_shared<const Verdict>(verdict);
}

CalibrationResult calibrate(const std::vector<ImageView>& references,
                            const std::vector<ImageView>& sources,
                            const std::vector<ImageView>& depths, const std::optional<Rig>& initial,
                            const CalibrationOptions& options, const Progress& progress,
                            const FlowEstimator& flow) {
    return calibrate_parts({}, references, sources, depths, initial, options, progress, flow);
}

}  // namespace xcalib

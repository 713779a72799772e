#include "xcalib/calibrate.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "base/parallel.hpp"
#include "calibrate/adam.hpp"
#include "calibrate/relative_depth.hpp"
#include "calibrate/start.hpp"
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

// Global search, then Levenberg-Marquardt from coarse to fine.
void search_and_refine(const WorkingImages& images, const ImageView& reference,
                       const ImageView& source, const std::optional<Rig>& initial, const Plan& plan,
                       const Progress& tell, CalibrationResult& result) {
    CalibrationReport& report = result.report;
    const int num_threads = plan.options.num_threads;
    tell("search", 0.05);
    const Start found = find_start(images, reference, source, initial, plan,
                                   [&](double share) { tell("search", 0.05 + 0.55 * share); });
    report.time.search = found.search_seconds;
    report.candidates = found.candidates;
    report.levels = found.levels;
    result.rig = found.rig;

    // All frames, from the level at which the start was found on some of them.
    const int from = plan.from_coarsest ? kFactors[0] : found.levels.back().factor;
    double limit = 0;
    // Half size decides, so it is solved to the finer tolerance: it makes up for what the coarse
    // level leaves, and at full size a step costs most.
    const auto tolerance = [](int factor) { return factor == 2 ? 1e-6 : 1e-5; };
    const std::vector<Step> steps =
        schedule(report.working_width, report.working_height, plan.parts);
    for (std::size_t s = 0; s < steps.size(); ++s) {
        if (steps[s].stage == 1 || steps[s].factor > from) continue;
        const Level level = make_level(images, steps[s].factor, result.rig, num_threads);
        if (limit == 0) limit = share_limit(pooled(level, result.rig, num_threads).valid_share);
        report.levels.push_back(solve_stage(images, level, steps[s].stage, limit,
                                            tolerance(steps[s].factor), plan, result.rig));
        tell("refine", 0.6 + 0.35 * static_cast<double>(s + 1) / static_cast<double>(steps.size()));
    }
}

// Estimates the shift of relative depth; images and rig are then those of the shifted depth.
void settle_relative_depth(const Plan& plan, WorkingImages& images, CalibrationResult& result) {
    const double farthest = farthest_inverse_depth(images);
    RelativeDepth relative = *plan.options.relative_depth;
    double shift = 0;
    if (plan.options.source_camera) {
        shift = best_shift(images, plan, farthest, result.rig);
        images = with_shifted_depth(images, shift);
        const Level level = make_level(images, 1, result.rig, plan.options.num_threads);
        result.report.levels.push_back(
            solve_level(level, {}, 2, share_limit(result.report.levels.back().valid_share), 1e-5,
                        plan, result.rig, result.rig));
    } else {
        shift = ordinary_shift(result.rig, farthest);
        images = with_shifted_depth(images, shift);
        result.rig = with_shifted_depth(result.rig, shift);
    }
    relative.shift += shift;
    result.rig.relative_depth = relative;
}

}  // namespace

CalibrationResult calibrate_parts(const Parts& parts, const std::vector<ImageView>& references,
                                  const std::vector<ImageView>& sources,
                                  const std::vector<ImageView>& depths,
                                  const std::optional<Rig>& initial,
                                  const CalibrationOptions& options, const Progress& progress,
                                  const FlowEstimator& flow) {
    const double start = seconds_now();
    const Progress tell = [&](const std::string& stage, double share) {
        if (progress) progress(stage, share);
    };
    const Plan plan(options, flow, parts);
    validate(references, sources, depths, initial, options);

    const WorkersOfThread workers(resolve_threads(options.num_threads));
    CalibrationResult result;
    CalibrationReport& report = result.report;
    report.frames =
        draw_frames(static_cast<int>(references.size()), options.max_frames, options.seed);
    tell("prepare", 0.0);
    WorkingImages images = make_working_images(references, sources, depths, report.frames, plan);
    report.working_width = images.references[0].width;
    report.working_height = images.references[0].height;

    if (options.solver == Solver::adam) {
        tell("refine", 0.05);
        result.rig = given_start(references[0], sources[0], initial, options);
        solve_adam(
            images, plan, [&](double share) { tell("refine", 0.05 + 0.9 * share); }, result.rig,
            report);
    } else {
        search_and_refine(images, references[0], sources[0], initial, plan, tell, result);
    }
    if (options.relative_depth) settle_relative_depth(plan, images, result);
    report.nec = report.levels.back().nec;
    report.valid_share = report.levels.back().valid_share;
    judge(images, result.rig, plan, report);
    result.converged = report.converged;
    tell("judge", 1.0);
    report.seconds = seconds_now() - start;
    const double search = report.time.search;
    report.time = images.times->seconds(resolve_threads(options.num_threads));
    report.time.search = search;
    return result;
}

CalibrationResult calibrate(const std::vector<ImageView>& references,
                            const std::vector<ImageView>& sources,
                            const std::vector<ImageView>& depths, const std::optional<Rig>& initial,
                            const CalibrationOptions& options, const Progress& progress,
                            const FlowEstimator& flow) {
    return calibrate_parts({}, references, sources, depths, initial, options, progress, flow);
}

}  // namespace xcalib

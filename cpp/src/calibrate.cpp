#include "xcalib/calibrate.hpp"

#include <algorithm>
#include <cmath>
#include <random>
#include <sstream>
#include <stdexcept>

#include "adam.hpp"
#include "parallel.hpp"
#include "relative_depth.hpp"
#include "solve.hpp"
#include "start.hpp"
#include "verdict.hpp"
#include "working_images.hpp"

namespace xcalib {
namespace {

void require(bool ok, const char* field, double value, const char* expected) {
    if (ok) return;
    std::ostringstream message;
    message << "options: " << field << " = " << value << ", expected " << expected;
    throw std::invalid_argument(message.str());
}

void require_size(const char* name, const std::optional<Pinhole>& camera, const ImageView& image) {
    if (!camera || (camera->width == image.width && camera->height == image.height)) return;
    std::ostringstream message;
    message << name << " is " << camera->width << "x" << camera->height << ", expected the images' "
            << image.width << "x" << image.height;
    throw std::invalid_argument(message.str());
}

// Global search, then Levenberg-Marquardt from coarse to fine.
void search_and_refine(const WorkingImages& images, const ImageView& reference,
                       const ImageView& source, const std::optional<Rig>& initial,
                       const CalibrationOptions& options, const FlowEstimator& flow,
                       const Progress& tell, CalibrationResult& result) {
    CalibrationReport& report = result.report;
    tell("search", 0.05);
    const Start found = find_start(images, reference, source, initial, options, flow,
                                   [&](double share) { tell("search", 0.05 + 0.55 * share); });
    report.time.search = found.search_seconds;
    report.candidates = found.candidates;
    report.levels = found.levels;
    result.rig = found.rig;

    // All frames, from the level at which the start was found on some of them; with flow from the
    // first at which everything is free, since flow reaches further the coarser the level is.
    const int from = options.flow == FlowMode::on ? kFactors[0] : found.levels.back().factor;
    double share_limit = 0;
    // The middle levels decide; what the coarse one leaves they find, and at the finest a step
    // costs most.
    const auto tolerance = [](int factor) { return factor == 2 ? 1e-6 : 1e-5; };
    const std::vector<Step> steps =
        schedule(report.working_width, report.working_height, options.parts);
    for (std::size_t s = 0; s < steps.size(); ++s) {
        if (steps[s].stage == 1 || steps[s].factor > from) continue;
        const Level level = make_level(images, steps[s].factor, result.rig, options.num_threads);
        if (share_limit == 0)
            share_limit = 0.8 * pooled(level, result.rig, options.num_threads).valid_share;
        report.levels.push_back(solve_stage(images, level, steps[s].stage, share_limit,
                                            tolerance(steps[s].factor), options, flow, result.rig));
        tell("refine", 0.6 + 0.35 * static_cast<double>(s + 1) / static_cast<double>(steps.size()));
    }
}

// Estimates the shift of relative depth; images and rig are then those of the shifted depth.
void settle_relative_depth(const CalibrationOptions& options, WorkingImages& images,
                           CalibrationResult& result) {
    const double farthest = farthest_inverse_depth(images);
    RelativeDepth relative = *options.relative_depth;
    double shift = 0;
    if (options.source_camera) {
        shift = best_shift(images, options, farthest, result.rig);
        images = with_shifted_depth(images, shift);
        const Level level = make_level(images, 1, result.rig, options.num_threads);
        result.report.levels.push_back(solve_level(level, {}, 2,
                                                   0.8 * result.report.levels.back().valid_share,
                                                   1e-5, options, result.rig, result.rig));
    } else {
        shift = ordinary_shift(result.rig, farthest);
        images = with_shifted_depth(images, shift);
        result.rig = with_shifted_depth(result.rig, shift);
    }
    relative.shift += shift;
    result.rig.relative_depth = relative;
}

}  // namespace

void CalibrationOptions::validate() const {
    require(max_frames >= 1, "max_frames", max_frames, "at least 1");
    require(num_threads >= 0, "num_threads", num_threads, "0 (every core) or more");
    require(working_width >= 64, "working_width", working_width, "at least 64 px");
    require(max_iterations >= 1, "max_iterations", max_iterations, "at least 1");
    require(std::isfinite(prior_weight) && prior_weight >= 0, "prior_weight", prior_weight,
            "a finite number >= 0");
    require(std::isfinite(flow_weight) && flow_weight > 0, "flow_weight", flow_weight,
            "a finite number > 0");
    require(flow_rounds >= 1, "flow_rounds", flow_rounds, "at least 1");
    if (reference_hfov_deg)
        require(*reference_hfov_deg > 0 && *reference_hfov_deg < 180, "reference_hfov_deg",
                *reference_hfov_deg, "an angle in (0, 180) deg");
    if (reference_camera) reference_camera->validate("options: reference_camera");
    if (source_camera) source_camera->validate("options: source_camera");
    require(search.max_fov_ratio > 1 && search.max_fov_ratio <= 10, "search.max_fov_ratio",
            search.max_fov_ratio, "a ratio in (1, 10]");
    require(search.max_roll_deg >= 0 && search.max_roll_deg <= 180, "search.max_roll_deg",
            search.max_roll_deg, "an angle in [0, 180] deg");
    require(search.min_overlap > 0 && search.min_overlap < 1, "search.min_overlap",
            search.min_overlap, "a share in (0, 1)");
    require(search.map_width >= 32, "search.map_width", search.map_width, "at least 32 px");
    require(search.candidates >= 1, "search.candidates", search.candidates, "at least 1");
    if (relative_depth) relative_depth->validate("options: relative_depth");
    if (solver != Solver::adam) return;
    if (search.mode == SearchMode::full || search.mode == SearchMode::local)
        throw std::invalid_argument(
            "options: solver = adam searches nothing, expected search.mode = automatic or off");
    require(adam.epochs >= 1, "adam.epochs", adam.epochs, "at least 1");
    require(adam.batch >= 1, "adam.batch", adam.batch, "at least 1");
    require(adam.learning_rate > 0 && std::isfinite(adam.learning_rate), "adam.learning_rate",
            adam.learning_rate, "a finite number > 0");
    require(adam.fine_learning_rate > 0 && std::isfinite(adam.fine_learning_rate),
            "adam.fine_learning_rate", adam.fine_learning_rate, "a finite number > 0");
    require(adam.decay > 0 && adam.decay <= 1, "adam.decay", adam.decay, "a factor in (0, 1]");
    require(adam.fine_from >= 0 && adam.fine_from <= 1, "adam.fine_from", adam.fine_from,
            "a share in [0, 1]");
    require(adam.translation_scales >= 1 && adam.translation_scales <= 3, "adam.translation_scales",
            adam.translation_scales, "1 to 3");
}

std::vector<int> choose_frames(int count, int max_frames, std::uint32_t seed) {
    if (count < 0 || max_frames < 1)
        throw std::invalid_argument("choose_frames: count = " + std::to_string(count) +
                                    " and max_frames = " + std::to_string(max_frames) +
                                    ", expected >= 0 and >= 1");
    std::vector<int> chosen;
    if (count <= max_frames) {
        for (int i = 0; i < count; ++i) chosen.push_back(i);
        return chosen;
    }
    // One from each of max_frames equal parts of the footage. The raw generator, since what the
    // standard's distributions draw differs between libraries.
    std::mt19937 generator(seed);
    for (int i = 0; i < max_frames; ++i) {
        const auto first = static_cast<std::int64_t>(count) * i / max_frames;
        const auto last = static_cast<std::int64_t>(count) * (i + 1) / max_frames;
        chosen.push_back(static_cast<int>(first + generator() % (last - first)));
    }
    return chosen;
}

CalibrationResult calibrate(const std::vector<ImageView>& references,
                            const std::vector<ImageView>& sources,
                            const std::vector<ImageView>& depths, const std::optional<Rig>& initial,
                            const CalibrationOptions& given, const Progress& progress,
                            const FlowEstimator& flow) {
    const double start = seconds_now();
    const Progress tell = [&](const std::string& stage, double share) {
        if (progress) progress(stage, share);
    };
    given.validate();
    CalibrationOptions options = given;
    if (flow && options.flow == FlowMode::automatic) options.flow = FlowMode::on;
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

    const WorkersOfThread workers(resolve_threads(options.num_threads));
    CalibrationResult result;
    CalibrationReport& report = result.report;
    report.frames =
        choose_frames(static_cast<int>(references.size()), options.max_frames, options.seed);
    tell("prepare", 0.0);
    WorkingImages images = make_working_images(references, sources, depths, report.frames, options);
    report.working_width = images.references[0].width;
    report.working_height = images.references[0].height;

    if (options.solver == Solver::adam) {
        tell("refine", 0.05);
        result.rig = given_start(references[0], sources[0], initial, options);
        solve_adam(
            images, options, flow, [&](double share) { tell("refine", 0.05 + 0.9 * share); },
            result.rig, report);
    } else {
        search_and_refine(images, references[0], sources[0], initial, options, flow, tell, result);
    }
    if (options.relative_depth) settle_relative_depth(options, images, result);
    report.nec = report.levels.back().nec;
    report.valid_share = report.levels.back().valid_share;
    judge(images, result.rig, options, report);
    result.converged = report.converged;
    tell("judge", 1.0);
    report.seconds = seconds_now() - start;
    const double search = report.time.search;
    report.time = images.times->seconds(resolve_threads(options.num_threads));
    report.time.search = search;
    return result;
}

}  // namespace xcalib

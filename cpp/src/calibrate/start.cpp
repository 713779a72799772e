#include "calibrate/start.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/parallel.hpp"
#include "solve/solve.hpp"
#include "xcalib/search.hpp"

namespace xcalib {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180;

// A camera of unknown intrinsics but its horizontal field of view.
Pinhole camera_guess(const ImageView& image, double hfov) {
    return Pinhole::from_hfov(image.width, image.height, hfov);
}

// The same camera with a lens that is given; none given, with its own.
Pinhole with_lens(Pinhole camera, const std::optional<Lens>& lens) {
    if (lens) camera.lens = *lens;
    return camera;
}

// Where the field of view of the reference makes little difference, it is the paper's 45 deg.
double preference(const Rig& rig) {
    const double ratio = std::log(rig.reference.width_by_focal() / (2 * std::tan(22.5 * kDegree)));
    return 1 - 0.12 * std::abs(ratio);
}

struct Candidate {
    Rig rig;
    double merit = 0.0;
    double share_limit = 0.0;
    std::size_t entry = 0;  // in the report
    std::vector<LevelReport> levels;
};

// Inverse depth where the reference has edges: 10th, 50th and 90th percentile [1/m].
struct InverseDepths {
    double low, median, high;
};

InverseDepths inverse_depths(const ReducedImages& images) {
    std::vector<double> values;
    for (std::size_t k = 0; k < images.depths.size(); ++k) {
        const std::vector<float>& depth = images.depths[k].pixels;
        double mean = 0;
        for (const auto& z : images.edges[k].z) mean += std::norm(z);
        mean /= static_cast<double>(depth.size());
        for (std::size_t i = 0; i < depth.size(); ++i)
            if (depth[i] > 0 && std::norm(images.edges[k].z[i]) > mean)
                values.push_back(1.0 / depth[i]);
    }
    if (values.empty()) return {0.0, 0.0, 0.0};
    std::sort(values.begin(), values.end());
    const auto at = [&](double share) { return values[std::size_t(share * (values.size() - 1))]; };
    return {at(0.1), at(0.5), at(0.9)};
}

// The same rig moved by `t`, and turned so that the middle of the image at the median depth stays
// where it is: what the search has found is kept, only the parallax changes.
Rig with_parallax(const Rig& rig, const Eigen::Vector3d& t, double inverse_depth) {
    const Eigen::Vector3d axis = rig.R() * Eigen::Vector3d::UnitZ();
    const Eigen::Quaterniond back = Eigen::Quaterniond::FromTwoVectors(
        axis + t * inverse_depth, axis + rig.t() * inverse_depth);
    Rig moved = rig;
    moved.source_from_reference.rotation = (back * rig.source_from_reference.rotation).normalized();
    moved.source_from_reference.translation = back * t;
    return moved;
}

// The same rig with a reference of another focal length: the source's follows, so that the scale
// stays, and rotation and translation, so that the middle of the image and its parallax do.
Rig with_reference_focal(const Rig& rig, const Eigen::Quaterniond& mount, double factor) {
    Rig out = rig;
    out.reference = rig.reference.zoomed(factor);
    out.source = rig.source.zoomed(factor);
    const Eigen::AngleAxisd rotation(rig.source_from_reference.rotation * mount.conjugate());
    const Eigen::Vector3d vector = rotation.angle() * rotation.axis();
    // Roll is an angle in the image; pan and tilt are displacements over the focal length.
    const Eigen::Vector3d scaled(vector.x() / factor, vector.y() / factor, vector.z());
    out.source_from_reference.rotation = mount;
    out = turn_source(out, scaled);
    out.source_from_reference.translation = rig.t() / factor;
    return out;
}

// Replaces the candidate's rig by the best of `count` variants, if any is better than it.
template <class Variant>
void choose_best(const Level& level, int num_threads, int count, const Variant& variant,
                 Candidate& candidate) {
    std::vector<double> merits(count);
    parallel_each(count, num_threads, [&](int i) {
        const Rig rig = variant(i);
        merits[i] = preference(rig) * merit(pooled(level, rig, 1));
    });
    const int best =
        static_cast<int>(std::max_element(merits.begin(), merits.end()) - merits.begin());
    if (merits[best] <= candidate.merit) return;
    candidate.merit = merits[best];
    candidate.rig = variant(best);
}

// The search sees one displacement for all depths, at coarse steps of scale and roll. This looks
// for the baseline that goes with it, and for what the search has rounded, on grids in turn whose
// steps are about a pixel of the level.
void place(const Level& level, const InverseDepths& inverse, bool free_focal, const Plan& plan,
           Candidate& candidate) {
    const CalibrationOptions& options = plan.options;
    const Eigen::Quaterniond mount(
        Eigen::AngleAxisd(plan.mount.roll_deg * kDegree, Eigen::Vector3d::UnitZ()));
    const Rig at_level = level.rig_at(candidate.rig);
    const double f = at_level.source.pixels_per_radian().x();
    const double half = 0.5 * level.width * at_level.source_density().x();
    candidate.merit =
        preference(candidate.rig) * merit(pooled(level, candidate.rig, options.num_threads));
    for (int round = 0; round < 2; ++round) {
        if (const double spread = f * (inverse.high - inverse.low); spread > 0) {
            const double step = 1.5 / spread;
            constexpr int kReachX = 6, kReachY = 4;  // baselines are mostly level
            const Rig& from = candidate.rig;
            choose_best(
                level, options.num_threads, (2 * kReachX + 1) * (2 * kReachY + 1),
                [&](int i) {
                    const int x = i % (2 * kReachX + 1) - kReachX,
                              y = i / (2 * kReachX + 1) - kReachY;
                    return with_parallax(from, mount * Eigen::Vector3d(x * step, y * step, 0),
                                         inverse.median);
                },
                candidate);
        }
        if (free_focal) {
            const Rig from = candidate.rig;
            constexpr int kFocals = 9;  // horizontal fields of view of 27 to 92 deg
            const double paper = 0.5 / std::tan(22.5 * kDegree);  // 45 deg, in widths
            choose_best(
                level, options.num_threads, kFocals,
                [&](int i) {
                    const double focal = paper * std::pow(1.2, i - 5);
                    return with_reference_focal(from, mount,
                                                focal * from.reference.width_by_focal());
                },
                candidate);
        }
        constexpr int kReach = 3;
        const int side = 2 * kReach + 1;
        const Rig before = candidate.rig;
        choose_best(
            level, options.num_threads, side * side,
            [&](int i) {  // scale and roll
                Rig rig = before;
                if (!options.source_camera) {
                    rig.source = before.source.zoomed(1 + (i % side - kReach) / half);
                }
                return turn_source(rig, Eigen::Vector3d(0, 0, (i / side - kReach) / half));
            },
            candidate);
        const Rig after = candidate.rig;
        choose_best(
            level, options.num_threads, side * side,
            [&](int i) {  // pan and tilt
                return turn_source(
                    after, Eigen::Vector3d((i / side - kReach) / f, (i % side - kReach) / f, 0));
            },
            candidate);
    }
}

// The same rig with k1 in its source's lens: what lies half-way to the sides of the image stays.
Rig with_k1(const Rig& rig, double k1) {
    const double shown = 0.3 * rig.source.field().width();
    const double radius =
        rig.source.lens.undistort({shown, 0}).value_or(Eigen::Vector2d(shown, 0)).x();
    Rig out = rig;
    out.source.lens = k1 == 0 ? Lens() : Lens(LensModel::brown, {k1, 0, 0, 0});
    out.source = out.source.zoomed(shown / (radius * (1 + k1 * radius * radius)));
    return out;
}

// A pinhole hardly finds what a strong lens shows: a few are tried.
void try_lenses(const Level& level, const Plan& plan, Candidate& candidate) {
    constexpr double kStep = -0.1, kCost = 0.1;
    constexpr int kCount = 5;
    const Rig from = candidate.rig;
    std::vector<double> merits(kCount);
    parallel_each(kCount, plan.options.num_threads, [&](int i) {
        merits[i] = (1 + kCost * kStep * i) * merit(pooled(level, with_k1(from, kStep * i), 1));
    });
    const auto best = std::max_element(merits.begin(), merits.end()) - merits.begin();
    candidate.rig = with_k1(from, kStep * static_cast<double>(best));
}

// Keeps the best `count`, best first.
void keep_best(std::vector<Candidate>& candidates, std::size_t count) {
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const Candidate& a, const Candidate& b) { return a.merit > b.merit; });
    if (candidates.size() > count) candidates.resize(count);
}

}  // namespace

SearchSpace search_space(const ImageView& reference, const ImageView& source,
                         const std::optional<Rig>& initial, const Plan& plan, double scale_step) {
    const CalibrationOptions& options = plan.options;
    constexpr double kRollStep = 4 * kDegree;
    const bool local = initial && options.search.mode != SearchMode::full;
    SearchSpace space;
    space.options = options.search;

    std::vector<Pinhole> cameras;
    if (options.reference_camera) {
        cameras = {*options.reference_camera};
    } else if (initial) {
        cameras = {initial->reference};
    } else if (options.reference_hfov_deg) {
        cameras = {Pinhole::from_hfov(reference.width, reference.height,
                                      *options.reference_hfov_deg * kDegree,
                                      options.reference_lens.value_or(Lens()))};
    } else {
        for (double hfov : {60.0, 40.0, 82.0})
            cameras.push_back(camera_guess(reference, hfov * kDegree));
    }
    for (Pinhole& camera : cameras) camera = with_lens(camera, options.reference_lens);
    for (const Pinhole& camera : cameras) {
        SearchHypothesis hypothesis{camera, {}};
        if (options.source_camera) {
            hypothesis.sources = {*options.source_camera};
        } else {
            // Fields of view are compared by their tangents, as focal lengths are, lenses aside.
            const Pinhole& centre = local ? initial->source : camera;
            const double ratio = local ? 1.15 : options.search.max_fov_ratio;
            const double widest = std::tan(60 * kDegree);
            const int steps = static_cast<int>(std::ceil(std::log(ratio) / std::log(scale_step)));
            for (int i = -steps; i <= steps; ++i) {
                const double scale = std::pow(ratio, static_cast<double>(i) / steps);
                const double tangent = scale * centre.width_by_focal() / 2;
                if (tangent > widest) continue;
                Pinhole guess = camera_guess(source, 2 * std::atan(tangent));
                if (initial) guess.lens = initial->source.lens;
                if (local) guess = initial->source.zoomed(1 / scale);
                hypothesis.sources.push_back(guess);
            }
        }
        for (Pinhole& guess : hypothesis.sources) guess = with_lens(guess, options.source_lens);
        space.hypotheses.push_back(hypothesis);
    }
    const double max_roll = (local ? 3.0 : options.search.max_roll_deg) * kDegree;
    const int rolls = static_cast<int>(std::lround(max_roll / kRollStep));
    // A rig that is given is where its mount is.
    const double middle = local ? 0.0 : plan.mount.roll_deg * kDegree;
    for (int i = -rolls; i <= rolls; ++i)
        space.rolls.push_back(middle + (rolls ? i * max_roll / rolls : 0.0));
    if (local) {
        space.base = initial->R();
        space.max_shift = 0.15;
    }
    return space;
}

std::vector<Step> schedule(int width, int height, const Parts& parts) {
    constexpr int kSmallestSide = 40;
    std::vector<Step> steps;
    if (!parts.pyramid) return {{1, parts.stages ? 1 : 2}, {1, 2}};
    for (int factor : {8, 4})
        if (parts.stages && std::min(width, height) / factor >= kSmallestSide)
            steps.push_back({factor, 1});
    for (int factor : {4, 2, 1})
        if (std::min(width, height) / factor >= kSmallestSide || factor == 1)
            steps.push_back({factor, 2});
    return steps;
}

Rig given_start(const ImageView& reference, const ImageView& source,
                const std::optional<Rig>& initial, const CalibrationOptions& options) {
    Rig rig;
    if (initial) {
        rig = *initial;
    } else {
        rig.reference = Pinhole::from_hfov(reference.width, reference.height,
                                           options.reference_hfov_deg.value_or(45) * kDegree,
                                           options.reference_lens.value_or(Lens()));
        rig.source = camera_guess(source, 45 * kDegree);
    }
    rig.reference =
        with_lens(options.reference_camera.value_or(rig.reference), options.reference_lens);
    rig.source = with_lens(options.source_camera.value_or(rig.source), options.source_lens);
    return rig;
}

Start find_start(const WorkingImages& all_images, const ImageView& reference,
                 const ImageView& source, const std::optional<Rig>& initial, const Plan& plan,
                 const std::function<void(double)>& progress) {
    constexpr std::size_t kFew = 6;
    const CalibrationOptions& options = plan.options;
    const WorkingImages images = all_images.spread(kStartFrames);
    const int num_threads = options.num_threads;
    const double start = seconds_now();
    Start out;

    std::vector<SearchCandidate> found;
    if (plan.searches) {
        found = global_search(images.reference_edges, images.source_edges,
                              search_space(reference, source, initial, plan), num_threads);
    } else {
        SearchCandidate given;
        given.rig = given_start(reference, source, initial, options);
        found = {given};
    }
    if (found.empty())
        throw NothingFound("the search found no displacement at which the images overlap");
    out.search_seconds = seconds_now() - start;
    progress(0.4);

    const std::vector<Step> steps =
        schedule(images.references[0].width, images.references[0].height, plan.parts);
    const int placing =
        schedule(images.references[0].width, images.references[0].height, {})[0].factor;
    const bool lens_free = plan.searches && plan.estimates_lens && !options.source_lens &&
                           !(initial && initial->source.lens.bends());
    const bool focal_free = !initial && !options.reference_camera && !options.reference_hfov_deg &&
                            !options.source_camera;
    // Placing costs hundreds of evaluations: fewer frames are enough.
    const WorkingImages few = images.spread(kFew);
    const InverseDepths inverse = inverse_depths(few.pyramid.at(kCoarse));
    std::vector<Candidate> candidates;
    for (const SearchCandidate& peak : found) {
        CandidateReport entry;
        entry.found = entry.refined = peak.rig;  // until it is refined, if it is
        entry.score = peak.score;
        entry.correlation = peak.correlation;
        entry.overlap = peak.overlap;
        Candidate candidate;
        candidate.rig = peak.rig;
        candidate.entry = out.candidates.size();
        // The search sees one displacement for all depths: where the middle depth is, it holds with
        // the given translation too.
        if (plan.searches && initial)
            candidate.rig = with_parallax(peak.rig, initial->t(), inverse.median);
        const Level level = make_level(few, placing, candidate.rig, num_threads);
        if (plan.searches) place(level, inverse, focal_free, plan, candidate);
        const NecValue value = pooled(level, candidate.rig, num_threads);
        if (!plan.searches) candidate.merit = merit(value);
        candidate.share_limit = share_limit(value.valid_share);
        candidates.push_back(candidate);
        out.candidates.push_back(entry);
    }
    progress(0.5);

    Plan quick = plan;  // enough to compare by; the winner is solved in full
    quick.options.max_iterations = std::min(options.max_iterations, 30);
    constexpr double kTolerance = 3e-5;

    // Halving: each level costs four times the last, and separates candidates better.
    for (std::size_t s = 0; s + 1 < steps.size() || s == 0; ++s) {
        if (s > 0 && steps[s].factor == 1) break;
        // Flow is expensive, and with one candidate nothing is compared: the refinement does the
        // rest.
        if (s > 0 && steps[s].stage == 2 && !plan.searches && plan.uses_flow) break;
        if (s == 0 || steps[s].factor != steps[s - 1].factor)
            keep_best(candidates, steps[s].factor > 4 ? 6 : steps[s].factor > 2 ? 4 : 2);
        for (Candidate& candidate : candidates) {
            const Level level = make_level(images, steps[s].factor, candidate.rig, num_threads);
            if (lens_free && steps[s].factor >= kCoarse && steps[s].stage == 2)
                try_lenses(level, plan, candidate);
            candidate.levels.push_back(
                plan.searches && plan.parts.images
                    ? solve_level(level, {}, steps[s].stage, candidate.share_limit, kTolerance,
                                  quick, candidate.rig, candidate.rig)
                    : solve_stage(images, level, steps[s].stage, candidate.share_limit, kTolerance,
                                  quick, candidate.rig));
            candidate.merit = merit(candidate.levels.back());
            out.candidates[candidate.entry].refined = candidate.rig;
            out.candidates[candidate.entry].refined_nec = candidate.levels.back().nec;
        }
        progress(0.5 + 0.5 * static_cast<double>(s + 1) / static_cast<double>(steps.size()));
    }
    keep_best(candidates, 1);
    out.rig = candidates[0].rig;
    out.merit = candidates[0].merit;
    out.levels = candidates[0].levels;
    return out;
}

}  // namespace xcalib

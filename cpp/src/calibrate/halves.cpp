#include "calibrate/halves.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "base/median.hpp"
#include "calibrate/judging.hpp"
#include "geometry/projector.hpp"
#include "solve/solve.hpp"

namespace xcalib {
namespace {

// Each half is searched on so many of its frames: two that agree are safer than one search of all.
constexpr std::size_t kHalfFrames = 6;

// From some of the half's frames to all of them. Half resolution is enough to tell whether two
// halves agree; what the finest level adds, the gradients of its frames show (error_model.hpp).
void refine_half(const WorkingImages& half, const Plan& plan, Start& start) {
    if (half.size() <= kHalfFrames || start.levels.back().factor != kJudgedFactor) return;
    const Level level = make_level(half, kJudgedFactor, start.rig, plan.options.num_threads);
    const double limit =
        share_limit(pooled(level, start.rig, plan.options.num_threads).valid_share);
    start.levels.push_back(solve_stage(half, level, 2, limit, 1e-5, plan, start.rig));
}

}  // namespace

std::array<std::vector<std::size_t>, 2> halves_of(std::size_t count) {
    constexpr std::size_t kBlocks = 4;
    const std::size_t blocks = std::min(count, kBlocks);
    std::array<std::vector<std::size_t>, 2> halves;
    for (std::size_t i = 0; i < count; ++i) halves[i * blocks / count % 2].push_back(i);
    return halves;
}

Halves fit_halves(const WorkingImages& images, const ImageView& reference, const ImageView& source,
                  const std::optional<Rig>& initial, const Plan& plan,
                  const std::function<void(double)>& progress) {
    Halves out;
    if (images.size() < 2) return out;
    out.independent = true;
    double best = -std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < 2; ++k) {
        const WorkingImages half = images.subset(halves_of(images.size())[k]);
        const auto notify = [&](double share) { progress(0.5 * (static_cast<double>(k) + share)); };
        try {
            Start start =
                find_start(half.spread(kHalfFrames), reference, source, initial, plan, notify);
            refine_half(half, plan, start);
            out.rigs[k] = start.rig;
            // The start of all frames is judged on all of them.
            const double here = merit_on(images, start.rig, plan);
            if (here <= best) continue;
            best = here;
            out.start = std::move(start);
        } catch (const NothingFound&) {
            continue;
        }
    }
    return out;
}

Halves refit_halves(const WorkingImages& images, const Rig& rig, const Plan& plan,
                    double valid_share) {
    Halves out;
    if (images.size() < 2) return out;
    Plan quick = plan;  // they start where all frames agree
    quick.options.max_iterations = std::min(plan.options.max_iterations, 12);
    for (std::size_t k = 0; k < 2; ++k) {
        const WorkingImages half = images.subset(halves_of(images.size())[k]);
        const Level level = make_level(half, kJudgedFactor, rig, plan.options.num_threads);
        Rig fitted = rig;
        solve_level(level, {}, 2, share_limit(valid_share), 1e-5, quick, rig, fitted);
        out.rigs[k] = fitted;
    }
    return out;
}

double merit_on(const WorkingImages& images, const Rig& rig, const Plan& plan) {
    const int num_threads = plan.options.num_threads;
    const Level level = make_level(images.spread(kStartFrames), kJudgedFactor, rig, num_threads);
    return merit(pooled(level, rig, num_threads));
}

bool agree(const Halves& halves, const WorkingImages& images) {
    return distance(halves, images) < kFarthest * images.references[0].width;
}

double distance(const Halves& halves, const WorkingImages& images) {
    if (!halves.rigs[0] || !halves.rigs[1]) return std::numeric_limits<double>::infinity();
    constexpr int kStep = 8;
    const Level sizes = make_sizes(images, kJudgedFactor, *halves.rigs[0]);
    const Rig a = sizes.rig_at(*halves.rigs[0]), b = sizes.rig_at(*halves.rigs[1]);
    const auto seen = [](const Pinhole& camera, const Eigen::Vector2d& at) {
        return at.x() >= 0 && at.y() >= 0 && at.x() <= camera.width - 1 &&
               at.y() <= camera.height - 1;
    };
    std::vector<double> distances;
    for (const Image& depth : images.pyramid.at(kJudgedFactor).depths)
        for (int y = 0; y < depth.height; y += kStep)
            for (int x = 0; x < depth.width; x += kStep) {
                const Eigen::Vector2d one = transfer(a, x, y, depth.row(y)[x]),
                                      other = transfer(b, x, y, depth.row(y)[x]);
                if (seen(a.source, one) && seen(b.source, other))
                    distances.push_back((one - other).norm());
            }
    if (distances.empty()) return std::numeric_limits<double>::infinity();
    return kJudgedFactor / a.source_density().x() * median(std::move(distances));
}

}  // namespace xcalib

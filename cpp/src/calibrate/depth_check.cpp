#include "calibrate/depth_check.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>
#include <vector>

#include "base/format.hpp"
#include "base/parallel.hpp"
#include "calibrate/judging.hpp"
#include "calibrate/static_edges.hpp"
#include "geometry/projector.hpp"
#include "solve/solve.hpp"

namespace xcalib {
namespace {

double mean(const std::vector<double>& values) {
    return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

// What edges gain by other depth, frame by frame. Few frames show little of how they scatter: they
// are joined by what is usual.
Rival rival_of(const std::vector<double>& given, const std::vector<double>& other) {
    constexpr double kUsual = 0.02, kUsualCounts = 3;  // of the agreement; as so many frames
    const double count = static_cast<double>(given.size()), agreement = mean(given);
    Rival out;
    out.agreement = mean(other);
    if (agreement <= 0) return out;
    out.gain = (out.agreement - agreement) / agreement;
    double sum = kUsualCounts * kUsual * kUsual;
    for (std::size_t i = 0; i < given.size(); ++i) {
        const double off = (other[i] - given[i]) / agreement - out.gain;
        sum += off * off;
    }
    out.error = std::sqrt(sum / (count - 1 + kUsualCounts) / count);
    return out;
}

// Inverse depth is linear over a plane: does it bend anywhere else than at an edge or two?
bool is_plane(const Image& depth) {
    constexpr double kBend = 0.005, kShare = 0.03;
    const auto inverse = [&](int x, int y) { return 1.0 / depth.row(y)[x]; };
    int known = 0, bent = 0;
    for (int y = 1; y + 1 < depth.height; ++y)
        for (int x = 1; x + 1 < depth.width; ++x) {
            const double here = inverse(x, y);
            const double across = inverse(x - 1, y) + inverse(x + 1, y) - 2 * here,
                         down = inverse(x, y - 1) + inverse(x, y + 1) - 2 * here;
            if (!std::isfinite(across + down)) continue;  // 0 is unknown
            ++known;
            bent += std::max(std::abs(across), std::abs(down)) > kBend * here;
        }
    return bent < kShare * known;
}

// One map of a scene for all frames of a camera that moves.
bool one_depth_for_all(const WorkingImages& images) {
    const std::vector<Image>& depths = images.pyramid.at(kJudgedFactor).depths;
    for (const Image& depth : depths)
        if (depth.pixels != depths[0].pixels) return false;
    return depths.size() > 1 && !is_plane(depths[0]) && !camera_stands_still(images);
}

// How well each frame's edges agree.
std::vector<double> agreement_of(const Level& level, const Rig& rig, int num_threads) {
    const Rig at_level = level.rig_at(rig);
    std::vector<double> values(level.pairs.size());
    parallel_each(static_cast<int>(values.size()), num_threads,
                  [&](int i) { values[i] = level.pairs[i]->evaluate(at_level).aligned; });
    return values;
}

// Some frames at the two levels that are looked at.
struct Levels {
    Level coarse, fine;
};

// The same after a short fit from the rig, coarse before fine.
struct Refitted {
    double coarse = 0;
    std::vector<double> fine;  // none where coarse edges agree no better than `hopeless`
};
Refitted refitted(const Levels& levels, Rig rig, const Plan& plan, double hopeless) {
    constexpr int kIterations = 12;
    Plan quick = plan;
    quick.options.max_iterations = std::min(plan.options.max_iterations, kIterations);
    const auto solve = [&](const Level& level) {
        const double share = pooled(level, rig, plan.options.num_threads).valid_share;
        return solve_level(level, {}, 2, share_limit(share), 1e-4, quick, rig, rig).aligned;
    };
    Refitted out;
    out.coarse = solve(levels.coarse);
    if (out.coarse <= hopeless) return out;
    solve(levels.fine);
    out.fine = agreement_of(levels.fine, rig, plan.options.num_threads);
    return out;
}

// Depth maps that are changed one by one.
template <class Change>
std::vector<Image> each(const std::vector<Image>& depths, const Change& change) {
    std::vector<Image> out = depths;
    for (Image& depth : out) change(depth);
    return out;
}
template <class Change>
std::vector<Image> each_pixel(const std::vector<Image>& depths, const Change& change) {
    return each(depths, [&](Image& depth) {
        for (float& z : depth.pixels)
            if (z > 0) z = static_cast<float>(change(z));
    });
}

// Over the same pixels: what is unknown, burnt-in text among it, stays where it is, and where the
// turned map knows nothing the own one does.
template <class Turn>
std::vector<Image> each_turned(const std::vector<Image>& depths, const Turn& turn) {
    return each(depths, [&](Image& depth) {
        const std::vector<float> own = depth.pixels;
        turn(depth);
        for (std::size_t i = 0; i < own.size(); ++i)
            if (!(own[i] > 0 && depth.pixels[i] > 0)) depth.pixels[i] = own[i];
    });
}

void mirror(Image& depth) {
    for (int y = 0; y < depth.height; ++y) std::reverse(depth.row(y), depth.row(y) + depth.width);
}

void turn_upside_down(Image& depth) {
    for (int y = 0; y < depth.height / 2; ++y)
        std::swap_ranges(depth.row(y), depth.row(y) + depth.width, depth.row(depth.height - 1 - y));
}

// Some frames at the levels that are looked at, prepared once for whatever depth: it is known
// everywhere, so that each depth is compared where it is known itself.
struct Prepared {
    WorkingImages images;
    std::map<int, Level> levels;

    Prepared(WorkingImages some, const std::vector<int>& factors, double depth, const Rig& rig,
             int num_threads)
        : images(std::move(some)) {
        WorkingImages flat = images;
        for (const int factor : factors) {
            for (Image& map : flat.pyramid.at(factor).depths)
                std::fill(map.pixels.begin(), map.pixels.end(), static_cast<float>(depth));
            levels[factor] = make_level(flat, factor, rig, num_threads);
        }
    }
    const std::vector<Image>& depths(int factor) const { return images.pyramid.at(factor).depths; }
    Level with(int factor, const std::vector<Image>& depths) const {
        return with_depths(levels.at(factor), depths, images);
    }
};

// Each frame with the depth of others, at the rig itself. They follow each other: those beside are
// the ones that depth is most often taken from.
void exchange(const WorkingImages& images, const Rig& rig, double middle, int num_threads,
              DepthCheck& out) {
    constexpr std::size_t kRun = 12;
    std::vector<std::size_t> following(std::min(images.size(), kRun));
    std::iota(following.begin(), following.end(), (images.size() - following.size()) / 2);
    const Prepared run(images.subset(following), {kJudgedFactor}, middle, rig, num_threads);
    const auto later = [&](std::size_t frames) {
        std::vector<Image> depths = run.depths(kJudgedFactor);
        std::rotate(depths.begin(), depths.begin() + static_cast<std::ptrdiff_t>(frames),
                    depths.end());
        return agreement_of(run.with(kJudgedFactor, depths), rig, num_threads);
    };
    const std::vector<double> own = later(0), far = later(following.size() / 2);
    out.own = mean(own);
    out.exchangeable = far != own;
    out.exchanged = rival_of(own, far);
    for (const bool next : {true, false}) {
        const Rival beside = rival_of(own, later(next ? 1 : following.size() - 1));
        if (beside.agreement <= out.beside.agreement) continue;
        out.beside = beside;
        out.beside_is_next = next;
    }
}

}  // namespace

bool Rival::is_better() const {
    constexpr double kGain = 0.03, kDeviations = 2.0;
    return gain - kDeviations * error > 0 && gain > kGain;
}

bool Rival::is_as_good() const {
    constexpr double kLoss = 0.03, kDeviations = 1.0;
    return gain - kDeviations * error > -kLoss;
}

DepthCheck check_depth(const WorkingImages& images, const Rig& rig, const DepthRange& depths,
                       const Plan& plan) {
    constexpr std::size_t kFrames = 6;
    const int num_threads = plan.options.num_threads;
    DepthCheck out;
    out.relief = depths.middle / depths.near - depths.middle / depths.far;
    const double x = (rig.reference.width - 1) / 2.0, y = (rig.reference.height - 1) / 2.0;
    out.parallax_px = (transfer(rig, x, y, depths.near) - transfer(rig, x, y, depths.far)).norm() /
                      rig.source_density().x() * 640 / rig.reference.width;
    out.is_plane = is_plane(images.pyramid.at(kJudgedFactor).depths[0]);
    out.one_for_all = one_depth_for_all(images);
    exchange(images, rig, depths.middle, num_threads, out);

    const Prepared few(images.spread(kFrames), {kCoarse, kJudgedFactor}, depths.middle, rig,
                       num_threads);
    const auto fitted = [&](const auto& change, double hopeless) {
        const auto changed = [&](int factor) {
            return few.with(factor, change(few.depths(factor)));
        };
        return refitted({changed(kCoarse), changed(kJudgedFactor)}, rig, plan, hopeless);
    };
    const Refitted right = fitted([](const std::vector<Image>& given) { return given; }, 0);
    if (right.fine.empty()) return out;
    out.refitted = mean(right.fine);
    // What coarse edges agree with clearly less, fine ones do too.
    const auto rival = [&](const auto& change) {
        const Refitted other = fitted(change, 0.95 * right.coarse);
        return other.fine.empty() ? Rival() : rival_of(right.fine, other.fine);
    };
    const auto by_pixel = [&](const auto& change) {
        return rival([&](const std::vector<Image>& depths) { return each_pixel(depths, change); });
    };
    out.none = by_pixel([&](float) { return depths.middle; });
    out.mirrored =
        rival([](const std::vector<Image>& depths) { return each_turned(depths, mirror); });
    out.upside_down = rival(
        [](const std::vector<Image>& depths) { return each_turned(depths, turn_upside_down); });
    // Relative depth is an inverse depth of unknown shift: its inverse says nothing.
    if (!plan.options.relative_depth)
        out.inverse = by_pixel([&](float z) { return depths.middle * depths.middle / z; });
    return out;
}

std::optional<Objection> wrong_depth(const DepthCheck& check) {
    constexpr double kRelief = 0.02;
    // Where depths move pixels by less, noise hides what a frame's own depth is worth, and that of
    // another moves them by less than the tolerance.
    constexpr double kParallax = 3.0;
    if (check.relief < kRelief)
        return Objection{"every depth is the same: the rig holds for things at that distance only",
                         "give the depth of each pixel; see docs/inputs.md for where to get it"};
    if (check.one_for_all)
        return Objection{"all frames have the same depth map, though the camera moves",
                         "give each frame its own depth"};
    if (!check.is_plane && check.inverse.is_better())
        return Objection{
            format("inverse depth fits better than the given depth: edges agree by %.3f, not %.3f",
                   check.inverse.agreement, check.refitted),
            "are the depth files disparity? Convert them to metres"};
    if (check.exchangeable && check.beside.is_better())
        return Objection{
            format("the depth of the %s frame fits better than each frame's own: edges agree by "
                   "%.3f, not %.3f",
                   check.beside_is_next ? "next" : "last", check.beside.agreement, check.own),
            "is the depth late or early, or one file short?"};
    for (const auto& [turned, how] : {std::pair(check.mirrored, "mirrored"),
                                      std::pair(check.upside_down, "turned upside down")})
        if (!check.is_plane && turned.is_better())
            return Objection{
                format("the depth maps fit better when they are %s: edges agree by %.3f, not %.3f",
                       how, turned.agreement, check.refitted),
                "turn the depth maps as the reference images are"};
    if (!check.is_plane && check.none.is_better())
        return Objection{
            format(
                "no depth at all fits better than the given depth: edges agree by %.3f, not %.3f",
                check.none.agreement, check.refitted),
            "is it registered to the reference images, and in their order?"};
    if (check.exchangeable && check.parallax_px > kParallax && check.exchanged.is_as_good())
        return Objection{
            format(
                "the depth of other frames fits as well as each frame's own: edges agree by %.3f, "
                "with their own by %.3f",
                check.exchanged.agreement, check.own),
            "do depth and images belong together: same frame, same way up, not mirrored?"};
    return std::nullopt;
}

}  // namespace xcalib

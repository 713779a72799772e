#include "calibrate/depth_check.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

#include "base/format.hpp"
#include "base/median.hpp"
#include "base/parallel.hpp"
#include "calibrate/static_edges.hpp"
#include "geometry/projector.hpp"
#include "solve/solve.hpp"

namespace xcalib {
namespace {

constexpr int kFactor = 2;

// Inverse depths of the footage, some of them [1/m].
std::vector<double> inverse_depths(const WorkingImages& images) {
    std::vector<double> values;
    for (const Image& depth : images.pyramid.at(8).depths)
        for (const float z : depth.pixels)
            if (z > 0) values.push_back(1 / z);
    return values;
}

// The same images with depths that `change` replaces, at the levels that are looked at.
template <class Change>
WorkingImages with_depths(const WorkingImages& images, const Change& change) {
    WorkingImages out = images;
    for (const int factor : {kCoarse, kFactor}) change(out.pyramid.at(factor).depths);
    return out;
}

template <class Change>
WorkingImages with_each_depth(const WorkingImages& images, const Change& change) {
    return with_depths(images, [&](std::vector<Image>& depths) {
        for (Image& depth : depths)
            for (float& z : depth.pixels)
                if (z > 0) z = static_cast<float>(change(z));
    });
}

// The same with each map turned by `turn`, over the same pixels: what is unknown, burnt-in text
// among it, stays where it is, and where the turned map knows nothing the own one does.
template <class Turn>
WorkingImages with_turned_depths(const WorkingImages& images, const Turn& turn) {
    return with_depths(images, [&](std::vector<Image>& depths) {
        for (Image& depth : depths) {
            const std::vector<float> own = depth.pixels;
            turn(depth);
            for (std::size_t i = 0; i < own.size(); ++i)
                if (!(own[i] > 0 && depth.pixels[i] > 0)) depth.pixels[i] = own[i];
        }
    });
}

// How well each frame's edges agree with the depth of the one that comes so much later.
std::vector<double> with_depth_of(const WorkingImages& images, std::size_t later, const Rig& rig,
                                  int num_threads) {
    const Level level =
        make_level(with_depths(images,
                               [&](std::vector<Image>& depths) {
                                   std::rotate(depths.begin(),
                                               depths.begin() + static_cast<std::ptrdiff_t>(later),
                                               depths.end());
                               }),
                   kFactor, rig, num_threads);
    const Rig at_level = level.rig_at(rig);
    std::vector<double> values(level.pairs.size());
    parallel_each(static_cast<int>(values.size()), num_threads,
                  [&](int i) { values[i] = level.pairs[i]->evaluate(at_level).aligned; });
    return values;
}

double mean(const std::vector<double>& values) {
    return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

// Of the mean of the differences, by their scatter.
double standard_error(const std::vector<double>& a, const std::vector<double>& b) {
    const double count = static_cast<double>(a.size()), difference = mean(a) - mean(b);
    double sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
        const double off = a[i] - b[i] - difference;
        sum += off * off;
    }
    return std::sqrt(sum / (count * std::max(1.0, count - 1)));
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
    const std::vector<Image>& depths = images.pyramid.at(kFactor).depths;
    for (const Image& depth : depths)
        if (depth.pixels != depths[0].pixels) return false;
    return depths.size() > 1 && !is_plane(depths[0]) && !camera_stands_still(images);
}

// How well edges agree after a short fit from the rig, coarse before fine.
struct Refitted {
    double coarse = 0, fine = 0;
};
Refitted refitted(const WorkingImages& images, Rig rig, const Plan& plan, double hopeless) {
    constexpr int kIterations = 12;
    Plan quick = plan;
    quick.options.max_iterations = std::min(plan.options.max_iterations, kIterations);
    const auto solve = [&](int factor) {
        const Level level = make_level(images, factor, rig, plan.options.num_threads);
        const double share = pooled(level, rig, plan.options.num_threads).valid_share;
        return solve_level(level, {}, 2, share_limit(share), 1e-4, quick, rig, rig).aligned;
    };
    Refitted out;
    out.coarse = solve(kCoarse);
    if (out.coarse > hopeless) out.fine = solve(kFactor);
    return out;
}

}  // namespace

DepthCheck check_depth(const WorkingImages& images, const Rig& rig, const Plan& plan) {
    constexpr std::size_t kRun = 12, kFrames = 6;
    const int num_threads = plan.options.num_threads;
    DepthCheck out;
    const std::vector<double> inverse = inverse_depths(images);
    if (inverse.empty()) return out;
    const double low = quantile(inverse, 0.05), middle = median(inverse),
                 high = quantile(inverse, 0.95);
    out.relief = (high - low) / middle;
    const double x = (rig.reference.width - 1) / 2.0, y = (rig.reference.height - 1) / 2.0;
    out.parallax_px = (transfer(rig, x, y, 1 / high) - transfer(rig, x, y, 1 / low)).norm() /
                      rig.source_density().x() * 640 / rig.reference.width;

    // Frames that follow each other: those beside are the ones that depth is most often taken from.
    std::vector<std::size_t> following(std::min(images.size(), kRun));
    std::iota(following.begin(), following.end(), (images.size() - following.size()) / 2);
    const WorkingImages run = images.subset(following);
    const std::vector<double> own = with_depth_of(run, 0, rig, num_threads),
                              other = with_depth_of(run, run.size() / 2, rig, num_threads);
    out.own = mean(own);
    out.exchanged = mean(other);
    for (std::size_t i = 0; i < run.size(); ++i) out.exchangeable |= own[i] != other[i];
    out.exchange_error = standard_error(own, other);
    out.one_for_all = one_depth_for_all(images);
    for (const bool next : {true, false}) {
        const std::vector<double> beside =
            with_depth_of(run, next ? 1 : run.size() - 1, rig, num_threads);
        if (mean(beside) <= out.beside) continue;
        out.beside = mean(beside);
        out.beside_error = standard_error(own, beside);
        out.beside_is_next = next;
    }

    const WorkingImages few = images.spread(kFrames);
    const Refitted given = refitted(few, rig, plan, 0);
    out.refitted = given.fine;
    // What coarse edges agree with clearly less, fine ones do too.
    const double hopeless = 0.95 * given.coarse;
    const auto fits = [&](const WorkingImages& changed) {
        return refitted(changed, rig, plan, hopeless).fine;
    };
    const auto instead = [&](const auto& change) { return fits(with_each_depth(few, change)); };
    out.none = instead([&](float) { return 1 / middle; });
    out.mirrored = fits(with_turned_depths(few, [](Image& depth) {
        for (int y = 0; y < depth.height; ++y)
            std::reverse(depth.row(y), depth.row(y) + depth.width);
    }));
    out.upside_down = fits(with_turned_depths(few, [](Image& depth) {
        for (int y = 0; y < depth.height / 2; ++y)
            std::swap_ranges(depth.row(y), depth.row(y) + depth.width,
                             depth.row(depth.height - 1 - y));
    }));
    // Relative depth is an inverse depth of unknown shift: its inverse says nothing.
    if (!plan.options.relative_depth)
        out.inverse = instead([&](float z) { return 1 / (middle * middle * z); });
    return out;
}

std::optional<Objection> wrong_depth(const DepthCheck& check) {
    // Measured on rendered rigs: depth of other frames, upside down or mirrored loses less than 2 %
    // to another frame's, right depth 6 % and more, and to its inverse it loses always.
    constexpr double kRelief = 0.02, kGain = 0.03, kParallax = 1.5;
    if (check.relief < kRelief)
        return Objection{"every depth is the same: the rig holds for things at that distance only",
                         "give the depth of each pixel; see docs/inputs.md for where to get it"};
    if (check.one_for_all)
        return Objection{"all frames have the same depth map, though the camera moves",
                         "give each frame its own depth"};
    if (check.inverse > (1 + kGain) * check.refitted)
        return Objection{
            format("inverse depth fits better than the given depth: edges agree by %.3f, not %.3f",
                   check.inverse, check.refitted),
            "are the depth files disparity? Convert them to metres"};
    if (check.exchangeable && check.beside - 2 * check.beside_error > (1 + kGain) * check.own)
        return Objection{
            format("the depth of the %s frame fits better than each frame's own: edges agree by "
                   "%.3f, not %.3f",
                   check.beside_is_next ? "next" : "last", check.beside, check.own),
            "is the depth late or early, or one file short?"};
    for (const auto& [turned, how] : {std::pair(check.mirrored, "mirrored"),
                                      std::pair(check.upside_down, "turned upside down")})
        if (turned > (1 + kGain) * check.refitted)
            return Objection{
                format("the depth maps fit better when they are %s: edges agree by %.3f, not %.3f",
                       how, turned, check.refitted),
                "turn the depth maps as the reference images are"};
    if (check.none > (1 + kGain) * check.refitted)
        return Objection{
            format(
                "no depth at all fits better than the given depth: edges agree by %.3f, not %.3f",
                check.none, check.refitted),
            "is it registered to the reference images, and in their order?"};
    if (check.exchangeable && check.parallax_px > kParallax &&
        check.own - check.exchanged + check.exchange_error < kGain * check.own)
        return Objection{
            format(
                "the depth of other frames fits as well as each frame's own: edges agree by %.3f, "
                "with their own by %.3f",
                check.exchanged, check.own),
            "do depth and images belong together: same frame, same way up, not mirrored?"};
    return std::nullopt;
}

}  // namespace xcalib

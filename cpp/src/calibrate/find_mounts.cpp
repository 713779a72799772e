#include "calibrate/find_mounts.hpp"

#include <algorithm>
#include <cmath>

#include "base/parallel.hpp"
#include "calibrate/start.hpp"
#include "xcalib/search.hpp"

namespace xcalib {
namespace {

constexpr double kRadiansPerDegree = 3.14159265358979323846 / 180;
// A peak of the search is wider than the step: what it rounds, the start from a mount finds.
constexpr double kRollStep = 8, kScaleStep = 1.12;
constexpr std::size_t kTriedFrames = 4;  // they decide on what is tried in full, no more

}  // namespace

WorkingImages with_mirrored_sources(const WorkingImages& images) {
    WorkingImages out = images;
    for (Image& source : out.sources)
        for (int y = 0; y < source.height; ++y)
            std::reverse(source.row(y), source.row(y) + source.width);
    // A direction theta becomes pi - theta, and its double -2 theta.
    for (EdgeMap& edges : out.source_edges)
        for (int y = 0; y < edges.height; ++y) {
            std::complex<float>* row = edges.z.data() + static_cast<std::size_t>(y) * edges.width;
            std::reverse(row, row + edges.width);
            std::transform(row, row + edges.width, row,
                           [](std::complex<float> z) { return std::conj(z); });
        }
    return out;
}

std::vector<Mount> find_mounts(const WorkingImages& all_images, const ImageView& reference,
                               const ImageView& source, const Plan& plan, std::size_t count) {
    SearchSpace space = search_space(reference, source, std::nullopt, plan, kScaleStep);
    space.hypotheses.resize(
        1);  // the field of view of the reference hardly changes which roll fits
    space.rolls.clear();
    for (double roll = 0; roll < 360; roll += kRollStep)
        space.rolls.push_back(roll * kRadiansPerDegree);
    const WorkingImages images = all_images.spread(kTriedFrames);
    struct Likely {
        Mount mount;
        double score;
    };
    std::vector<Likely> likely;
    for (const bool mirrored : {false, true}) {
        const WorkingImages seen = mirrored ? with_mirrored_sources(images) : images;
        for (const SearchCandidate& found : global_search(seen.reference_edges, seen.source_edges,
                                                          space, plan.options.num_threads)) {
            Mount mount = Mount::of(found.rig);
            mount.mirrored = mirrored;
            likely.push_back({mount, found.score});
        }
    }
    std::stable_sort(likely.begin(), likely.end(),
                     [](const Likely& a, const Likely& b) { return a.score > b.score; });
    const auto near = [](const Mount& a, const Mount& b) {
        return a.mirrored == b.mirrored &&
               std::abs(std::remainder(a.roll_deg - b.roll_deg, 360.0)) < kRollStep;
    };
    std::vector<Mount> out;
    for (const Likely& next : likely)
        if (out.size() < count && !near(next.mount, {}) &&
            std::none_of(out.begin(), out.end(),
                         [&](const Mount& known) { return near(known, next.mount); }))
            out.push_back(next.mount);
    return out;
}

}  // namespace xcalib

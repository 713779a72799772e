#include "xcalib/depth/fit_plane.hpp"

#include <algorithm>
#include <array>
#include <map>
#include <string>

#include "base/format.hpp"
#include "xcalib/calibrate.hpp"

namespace xcalib {
namespace {

constexpr int kFrames = 12;
constexpr int kWidth = 320;  // working width at which planes are judged [px]

// What is looked for, in which steps, and how many either way: fits have maxima of their own
// between a guess and the best, so that going uphill from the guess is not enough.
struct Scan {
    double PlaneDepth::*field;
    double step;
    int count;
};
constexpr Scan kScans[] = {{&PlaneDepth::horizon, 0.04, 3}, {&PlaneDepth::roll_deg, 1.5, 1}};
constexpr int kHalvings = 2;  // of the steps, around the best of the scan

// Planes that are reached by two ways are one.
double six_digits(double value) { return std::stod(format("%.6f", value)); }

}  // namespace

std::vector<int> frames_to_judge_plane(int count) {
    std::vector<int> frames;
    for (int i = 0; i < count; i += (count + kFrames - 1) / kFrames) frames.push_back(i);
    return frames;
}

PlaneDepth fit_plane(const std::vector<ImageView>& references,
                     const std::vector<ImageView>& sources, const PlaneDepth& plane, const Rig& rig,
                     const CalibrationOptions& options, const std::function<void()>& progress) {
    CalibrationOptions quick;
    quick.num_threads = options.num_threads;
    quick.working_width = std::min(kWidth, options.working_width);
    quick.optimize_reference = options.optimize_reference;
    quick.reference_camera = options.reference_camera;
    quick.source_camera = options.source_camera;
    quick.reference_lens = options.reference_lens;
    quick.source_lens = options.source_lens;
    quick.search.mode = SearchMode::off;
    quick.flow = FlowMode::off;  // the plane before is near enough

    using Key = std::array<double, 2>;
    const auto key = [](const PlaneDepth& p) { return Key{p.horizon, p.roll_deg}; };
    struct Fit {
        double nec;
        Rig rig;
    };
    std::map<Key, Fit> known;
    const auto fit = [&](const PlaneDepth& candidate, const Rig& start) {
        if (known.count(key(candidate))) return;
        const Image depth = candidate(references[0].width, references[0].height);
        const std::vector<ImageView> depths(references.size(), depth.view());
        const CalibrationResult result = calibrate(references, sources, depths, start, quick);
        known[key(candidate)] = {result.report.nec, result.rig};
        if (progress) progress();
    };

    PlaneDepth best = plane;
    fit(best, rig);
    for (int halving = 0; halving <= kHalvings; ++halving)
        for (const Scan& scan : kScans) {
            // The best of the planes within some steps; each fit starts at its neighbour's.
            const PlaneDepth middle = best;
            for (const int sign : {-1, 1}) {
                PlaneDepth neighbour = middle;
                for (int k = 1; k <= (halving == 0 ? scan.count : 1); ++k) {
                    PlaneDepth candidate = middle;
                    candidate.*scan.field =
                        six_digits(middle.*scan.field + sign * k * scan.step / (1 << halving));
                    fit(candidate, known[key(neighbour)].rig);
                    if (known[key(candidate)].nec > known[key(best)].nec) best = candidate;
                    neighbour = candidate;
                }
            }
        }
    return best;
}

}  // namespace xcalib

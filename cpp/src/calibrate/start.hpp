// Where a calibration starts: the global search, and the choice among what it finds.
#pragma once

#include <cmath>
#include <functional>
#include <optional>
#include <stdexcept>
#include <vector>

#include "solve/working_images.hpp"
#include "xcalib/calibration_report.hpp"
#include "xcalib/search.hpp"

namespace xcalib {

// One step of the schedule: the paper's stage at a level of the pyramid.
struct Step {
    int factor;
    int stage;
};

// Stage 1 holds at the coarse levels, where the dominant parameters are found, and everything is
// free from there on. Levels too small to have edges are left out, but for the finest.
std::vector<Step> schedule(int width, int height, const Parts& parts);

// Where a full or a local search looks, at steps of the scale by so much.
inline constexpr double kFineScaleStep = 1.06;
SearchSpace search_space(const ImageView& reference, const ImageView& source,
                         const std::optional<Rig>& initial, const Plan& plan,
                         double scale_step = kFineScaleStep);

// What candidates are compared by: how well edges agree beyond chance, and over how much of the
// image. Chance grows as the overlap shrinks. `value`: a NecValue or a LevelReport.
template <class Value>
double merit(const Value& value) {
    return value.aligned * std::sqrt(value.valid_share);
}

struct NothingFound : std::runtime_error {
    using std::runtime_error::runtime_error;
};

struct Start {
    Rig rig;
    std::vector<CandidateReport> candidates;
    std::vector<LevelReport> levels;  // that led to `rig`
    double search_seconds = 0.0;
    double merit = 0.0;  // how well edges agree beyond chance, and over how much of the image
};

// Where nothing is searched: the initial rig, or the paper's start, 45 deg and the identity; known
// cameras are taken as they are.
Rig given_start(const ImageView& reference, const ImageView& source,
                const std::optional<Rig>& initial, const CalibrationOptions& options);

// Of more frames than these, so many are looked at.
inline constexpr std::size_t kStartFrames = 8;

// `reference` and `source` give the sizes of the cameras. Throws NothingFound.
Start find_start(const WorkingImages& images, const ImageView& reference, const ImageView& source,
                 const std::optional<Rig>& initial, const Plan& plan,
                 const std::function<void(double)>& progress);

}  // namespace xcalib

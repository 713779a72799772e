// Where a calibration starts: the global search, and the choice among what it finds.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "solve/working_images.hpp"
#include "xcalib/calibration_report.hpp"

namespace xcalib {

// One step of the schedule: the paper's stage at a level of the pyramid.
struct Step {
    int factor;
    int stage;
};

// Stage 1 holds at the coarse levels, where the dominant parameters are found, and everything is
// free from there on. Levels too small to have edges are left out, but for the finest.
std::vector<Step> schedule(int width, int height, const Parts& parts);

struct Start {
    Rig rig;
    std::vector<CandidateReport> candidates;
    std::vector<LevelReport> levels;  // that led to `rig`
    double search_seconds = 0.0;
};

// Where nothing is searched: the initial rig, or the paper's start, 45 deg and the identity; known
// cameras are taken as they are.
Rig given_start(const ImageView& reference, const ImageView& source,
                const std::optional<Rig>& initial, const CalibrationOptions& options);

// `reference` and `source` give the sizes of the cameras.
Start find_start(const WorkingImages& images, const ImageView& reference, const ImageView& source,
                 const std::optional<Rig>& initial, const Plan& plan,
                 const std::function<void(double)>& progress);

}  // namespace xcalib

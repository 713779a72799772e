// The paper's own solver: Adam on its parameterization, schedule and batches, with the costs and
// gradients of this library.
#pragma once

#include <functional>

#include "solve/working_images.hpp"
#include "xcalib/calibration_report.hpp"

namespace xcalib {

// From `rig`, which is replaced; writes the report's steps and levels. `progress` gets the share
// of the steps taken.
void solve_adam(const WorkingImages& images, const Plan& plan,
                const std::function<void(double)>& progress, Rig& rig, CalibrationReport& report);

}  // namespace xcalib

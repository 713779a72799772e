// Is a calibration to be trusted? Judged from the footage alone.
#pragma once

#include "calibrate/halves.hpp"
#include "solve/working_images.hpp"
#include "xcalib/calibration_report.hpp"

namespace xcalib {

// `finest`: the level that `rig` was solved at last. Fills verdict, converged, message,
// baseline_nec, contrast, repeatability_px and visible_shift_px of the report.
void judge(const WorkingImages& images, const Level& finest, const Rig& rig, const Halves& halves,
           const Plan& plan, CalibrationReport& report);

}  // namespace xcalib

// Calibration with parts of the method off: for experiments, not for users.
#pragma once

#include "solve/plan.hpp"
#include "xcalib/calibrate.hpp"

namespace XCALIB_EXPORT xcalib {

// As calibrate().
CalibrationResult calibrate_parts(const Parts& parts, const std::vector<ImageView>& references,
                                  const std::vector<ImageView>& sources,
                                  const std::vector<ImageView>& depths,
                                  const std::optional<Rig>& initial,
                                  const CalibrationOptions& options, const Progress& progress,
                                  const FlowEstimator& flow);

}  // namespace xcalib

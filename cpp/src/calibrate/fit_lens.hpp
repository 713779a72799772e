// Whether the source has a lens that bends: k1 and k2 beside everything else, kept only where
// frames gain by them that the fit has not seen, or where they are asked for.
#pragma once

#include "solve/plan.hpp"
#include "solve/working_images.hpp"
#include "xcalib/calibration_report.hpp"

namespace xcalib {

// From this level of the pyramid on.
inline constexpr int kLensFactor = 2;

// `rig` is solved at `level` with no lens to move; where one is kept, it is replaced.
LensReport fit_lens(const Level& level, double share_limit, double tolerance, const Plan& plan,
                    Rig& rig);

}  // namespace xcalib

#pragma once

#include "xcalib/export.hpp"

namespace XCALIB_EXPORT xcalib {

// Where the time of a calibration goes [s]: the sum over threads divided by their number. The rest
// is the verdict, flow and waiting.
struct CalibrationTimes {
    double prepare = 0.0;   // working images and the levels of their pyramid
    double search = 0.0;    // the global search
    double warp = 0.0;      // reprojection and sampling of the passes over image pairs
    double value = 0.0;     // the rest of the passes that have no derivatives
    double jacobian = 0.0;  // the rest of those that have
    double solver = 0.0;    // Ceres, but for its evaluations
};

}  // namespace xcalib

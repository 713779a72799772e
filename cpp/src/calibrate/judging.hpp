// Where a fit is judged, and in what.
#pragma once

namespace xcalib {

// Half resolution: fine enough to separate a fit from a near miss, a quarter of the cost.
inline constexpr int kJudgedFactor = 2;
// [px] of the reference, in whose pixels errors are given.
inline constexpr double kUnitWidth = 640;

}  // namespace xcalib

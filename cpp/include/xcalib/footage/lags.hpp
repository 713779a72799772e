// Whether the source is late by whole frames: the fit with the sources of the frames around.
//
// A rig is refitted with each reference paired with the source some frames earlier and later, and
// the NEC of the same reference is compared. A source that is late on a steady drive is a rig of
// its own, with the way of a frame as its t_z, and as good a fit but for what moves or turns
// unevenly. So lags are told by differences frame by frame, beside how much these scatter.
#pragma once

#include <vector>

#include "xcalib/calibrate.hpp"
#include "xcalib/export.hpp"

namespace XCALIB_EXPORT xcalib {

inline constexpr int kMaxLag = 3;         // looked at either way
inline constexpr int kMaxLagFrames = 12;  // that are looked at
inline constexpr int kMinLagFrames = 6;   // of a lag, below which it is not judged

// One source for each reference, an empty view where the footage has none.
struct SourcesAtLag {
    int lag = 0;
    std::vector<ImageView> sources;
};

// `rig`: fitted to the references with the sources at lag 0, with `options`. `lags`: rising, 0
// among them, whose sources are all there. Throws std::invalid_argument.
LagReport fit_lags(const std::vector<ImageView>& references, const std::vector<ImageView>& depths,
                   const std::vector<SourcesAtLag>& lags, const Rig& rig,
                   const CalibrationOptions& options);

}  // namespace xcalib

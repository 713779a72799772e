// The lags of footage: fit_lags() on the frames of streams.
#pragma once

#include <functional>
#include <vector>

#include "xcalib/calibrate.hpp"
#include "xcalib/export.hpp"
#include "xcalib/footage/lags.hpp"
#include "xcalib/stream/frames.hpp"

namespace XCALIB_EXPORT xcalib {

// Frames that a calibration was made on, and where their sources are among all.
struct FittedFrames {
    std::vector<ImageView> references, sources, depths;
    std::vector<int> partners;  // in all sources
};

// Looks at the sources before and after those of a dozen of the frames; where the footage is no
// sequence, or too short, there is nothing to see, and nothing is read. Frames that cannot be
// decoded are left out. `progress` is called with the share of the frames read, and may throw.
LagReport fit_lags(const FittedFrames& frames, Stream& all_sources, const Rig& rig,
                   const CalibrationOptions& options, const std::function<void(double)>& progress);

// The report in the result, which is no longer trusted if the source is late beyond `offset`.
void add_lags(const LagReport& lag, const TimeOffset& offset, const Stream& all_sources,
              CalibrationResult& result);

}  // namespace xcalib

// Streams whose frames are straightened, see rolling_shutter.hpp.
#pragma once

#include <functional>

#include "xcalib/export.hpp"
#include "xcalib/footage/rolling_shutter.hpp"
#include "xcalib/stream/frames.hpp"
#include "xcalib/stream/neighbours.hpp"

namespace XCALIB_EXPORT xcalib {

// Between two gray images of 8 bits and one size; of the first one's size. Called from any thread,
// where the stream may be read from any.
using EstimateMotion = std::function<Motion(const ImageView& from, const ImageView& to)>;

// The sources of a sequence, each straightened by the motion to the next one, or else from the last
// one; as it is where neither is there. The stream itself where nothing is read row by row. Throws
// InputError where the frames do not follow each other.
StreamPointer straightened(const StreamPointer& sources, const Readout& readout,
                           const std::optional<Rig>& rig, const EstimateMotion& motion,
                           bool nearest);

// `known` with what is not: the readout of the source, or the reference's if `of_reference`, as a
// dozen of the fitted frames show it. `all_sources`: as they were read; `frames.sources` are not
// looked at.
ReadoutFit fit_readout(const FittedFrames& frames, const StreamPointer& all_sources, const Rig& rig,
                       const CalibrationOptions& options, const Readout& known, bool of_reference,
                       const EstimateMotion& motion, const std::function<void(double)>& progress);

}  // namespace xcalib

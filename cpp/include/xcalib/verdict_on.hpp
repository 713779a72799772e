// Does a rig hold on frames that it was not calibrated on?
#pragma once

#include <vector>

#include "xcalib/camera.hpp"
#include "xcalib/export.hpp"
#include "xcalib/image.hpp"
#include "xcalib/verdict.hpp"

namespace XCALIB_EXPORT xcalib {

// As a calibration of these frames, given as calibrate() takes them, would have it: the source's
// pose is fitted anew to them and judged, and must lie within the default tolerance of the rig's.
// What the cameras see by themselves is kept.
Verdict verdict_on(const std::vector<ImageView>& references, const std::vector<ImageView>& sources,
                   const std::vector<ImageView>& depths, const Rig& rig, int num_threads = 0);

}  // namespace xcalib

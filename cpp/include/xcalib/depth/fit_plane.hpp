// The road plane that suits footage best.
#pragma once

#include <functional>
#include <vector>

#include "xcalib/calibration_options.hpp"
#include "xcalib/camera.hpp"
#include "xcalib/depth/plane_depth.hpp"
#include "xcalib/export.hpp"
#include "xcalib/image.hpp"

namespace XCALIB_EXPORT xcalib {

// Those of `count` frames that judge a plane: at most a dozen, evenly spread.
std::vector<int> frames_to_judge_plane(int count);

// The plane near `plane` whose best rig aligns most edges: a horizon that is a few pixels off bends
// the depth of the far road, where it is largest, and no rig makes up for it, so that the NEC of a
// fit decides. Height, far distance and field of view are kept: the height scales depth and
// translation alike, and the images do not change. `rig`: fitted with `plane`, where fits start.
// `options`: known cameras and threads are kept. `progress` is called after each fit.
PlaneDepth fit_plane(const std::vector<ImageView>& references,
                     const std::vector<ImageView>& sources, const PlaneDepth& plane, const Rig& rig,
                     const CalibrationOptions& options, const std::function<void()>& progress);

}  // namespace xcalib

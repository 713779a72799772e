// Does the source show the reference's own detail? Where it is the same footage, or a thermal image
// with visible edges drawn into it, the fit is theirs.
#pragma once

#include "solve/working_images.hpp"

namespace xcalib {

// How far edges that meet have the same sign, from -1 (all reversed) to 1; of real thermal and
// visible images it is about 0, since warm is as often bright as dark.
double same_sign(const WorkingImages& images, const Rig& rig, int num_threads);

}  // namespace xcalib

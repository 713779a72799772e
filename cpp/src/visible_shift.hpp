// How far the registered source still lies off the reference, as flow between the two sees it.
#pragma once

#include "working_images.hpp"

namespace xcalib {

// The length of the shift [working px] that varies linearly over the image, which 90 % of what the
// source sees is below: what a wrong rig leaves varies so, roughly, and what flow mistakes does
// not. NaN where flow can tell of too few places. The built-in flow, over up to 4 of the pairs.
double visible_shift(const WorkingImages& images, const Rig& rig, int num_threads);

}  // namespace xcalib

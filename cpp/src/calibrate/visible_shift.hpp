// How far the registered source still lies off the reference, as flow between the two sees it.
#pragma once

#include "solve/working_images.hpp"

namespace xcalib {

// The shift is fitted as linear over the image; returned is the length that 90 % of the pixels do
// not exceed [working px]. What a wrong rig leaves varies so, roughly, and what flow mistakes does
// not. NaN where flow is known for too little of what the source sees. The built-in flow, on up to
// 4 pairs.
double visible_shift(const WorkingImages& images, const Rig& rig, int num_threads);

}  // namespace xcalib

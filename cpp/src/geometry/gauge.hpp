// What pixels do not tell where no lens bends: the camera of the reference.
#pragma once

#include "xcalib/camera.hpp"
#include "xcalib/export.hpp"

namespace XCALIB_EXPORT xcalib {  // the library of calibration, another, has it from here

// The rig that sends every pixel to where `rig` does, with another camera of the reference: only
// the source's camera and place differ. Both focal lengths are `focal` times as long, and the
// principal point lies (dx, dy) px aside. For rigs without lenses and mirrors.
Rig with_other_reference(const Rig& rig, double focal, double dx, double dy);

}  // namespace xcalib

// How the frames of a camera move.
#pragma once

#include "xcalib/footage/rolling_shutter.hpp"

namespace xcalib::cli {

// Dense optical flow, OpenCV's DIS, between gray images of 8 bits and one size.
Motion motion_between(const ImageView& from, const ImageView& to);

}  // namespace xcalib::cli

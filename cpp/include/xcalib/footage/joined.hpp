// Frames that hold two images: thermal cameras send a picture above its raw counts, stereo cameras
// both views side by side.
#pragma once

#include <string>
#include <vector>

#include "xcalib/export.hpp"
#include "xcalib/image.hpp"

namespace XCALIB_EXPORT xcalib {

// A line where most of the images look like two, joined at their middle: twice as high (or wide) as
// cameras' images are, with a seam there; else nothing. `name`: REFERENCE or SOURCE.
std::string joined_line(const std::vector<ImageView>& images, const std::string& name);

}  // namespace xcalib

// Frames that hold two images: thermal cameras send a picture above its raw counts, stereo cameras
// both views side by side.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "xcalib/export.hpp"
#include "xcalib/image.hpp"

namespace XCALIB_EXPORT xcalib {

// What is wrong, and what to give instead, where most of the images look like two, joined at their
// middle: twice as high (or wide) as cameras' images are, with a seam there; else empty. `name`:
// REFERENCE or SOURCE.
std::pair<std::string, std::string> joined_images(const std::vector<ImageView>& images,
                                                  const std::string& name);

}  // namespace xcalib

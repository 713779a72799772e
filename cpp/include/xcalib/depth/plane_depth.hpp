// Depth from a prior on the road: a flat one under the camera, and everything else far away.
#pragma once

#include "xcalib/error.hpp"
#include "xcalib/export.hpp"
#include "xcalib/image.hpp"

namespace XCALIB_EXPORT xcalib {

// D(x, y) = camera_height * fy / r(x, y), where r is the distance of a pixel below the horizon
// [px], never beyond `far`, which is also the depth at and above the horizon.
struct PlaneDepth {
    double camera_height = 1.6;  // of the reference camera above the road [m], > 0
    double horizon = 0.5;        // its row in the middle column, of the image height from the top,
                                 // (-1, 1)
    double far = 60.0;           // largest depth [m], > 0
    double hfov_deg = 45.0;      // of the reference camera, (0, 180); pixels are square
    double roll_deg = 0.0;       // how far the horizon falls towards the right, (-45, 45)

    void validate() const;  // throws InputError: field, value, range
    Image operator()(int width, int height) const;
};

}  // namespace xcalib

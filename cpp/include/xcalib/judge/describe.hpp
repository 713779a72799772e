// The facts of a rig, in units one can picture.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "xcalib/camera.hpp"
#include "xcalib/export.hpp"

namespace XCALIB_EXPORT xcalib {

struct RigFacts {
    // Turn of the source camera out of the reference camera's axes: pan to the right, then tilt up,
    // then roll clockwise.
    double pan_deg = 0.0, tilt_deg = 0.0, roll_deg = 0.0;
    Eigen::Vector3d position;  // of the source camera in the reference camera's frame [m]
    double baseline = 0.0;     // [m]
    struct Centre {
        std::optional<double> depth;  // [m]; none: infinity
        Eigen::Vector2d point;        // of the reference image's centre there, in the source image
                                      // [px]; NaN where it lies behind the source camera
        double parallax = 0.0;        // distance from the point at infinity [px]
    };
    std::vector<Centre> centre;
};

RigFacts describe(const Rig& rig);
std::string facts_text(const Rig& rig);  // lines for people, without a line break at the end

}  // namespace xcalib

// Does the depth belong to the images? Where it does, each frame's own depth aligns its edges
// better than another frame's, and better than none or its inverse, whatever rig goes with those.
#pragma once

#include <optional>

#include "calibrate/plausible.hpp"
#include "solve/working_images.hpp"

namespace xcalib {

struct DepthCheck {
    // How well edges agree beyond chance at half resolution, some frames, with each frame's depth,
    // and with that of a frame some way off.
    double own = 0.0, exchanged = 0.0;
    bool exchangeable = false;  // they differ from frame to frame
    // One map for all frames, in which things stand, though the camera moves past them. (A road
    // plane is one map too, and means it.)
    bool one_for_all = false;
    double exchange_error =
        0.0;  // standard error of their difference, from its scatter over frames
    double beside = 0.0, beside_error = 0.0;  // the better of the two neighbours' depth
    bool beside_is_next = false;
    // The same on some frames, each after a short fit: with one depth everywhere, and with inverse
    // depth in place of depth; 0 where coarse edges show already that it is less.
    double refitted = 0.0, none = 0.0, inverse = 0.0;
    double parallax_px = 0.0;  // what the depths from 5 to 95 % move [px at 640 px of width]
    double relief = 0.0;       // the range from 5 to 95 % of inverse depths, over their median
};
DepthCheck check_depth(const WorkingImages& images, const Rig& rig, const Plan& plan);

// What is wrong with the depth; none where nothing is seen to be.
std::optional<Objection> wrong_depth(const DepthCheck& check);

}  // namespace xcalib

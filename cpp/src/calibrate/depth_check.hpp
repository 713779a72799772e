// Does the depth belong to the images? Where it does, each frame's own depth aligns its edges
// better than another frame's, and better than none or its inverse, whatever rig goes with those.
#pragma once

#include <optional>

#include "calibrate/plausible.hpp"
#include "solve/working_images.hpp"

namespace xcalib {

// Other depth in place of the given one.
struct Rival {
    double agreement = 0.0;  // of edges beyond chance, mean over some frames
    double gain = 0.0;       // over that with the given depth, as a share of that
    double error = 0.0;      // its standard error, by its scatter over the frames

    // By more than chance, and by enough to matter.
    bool is_better() const;
    // Not even clearly worse.
    bool is_as_good() const;
};

// Depths that 5, 50 and 95 % of the footage are nearer than [m].
struct DepthRange {
    double near, middle, far;
};

struct DepthCheck {
    // How well edges agree beyond chance at half resolution, some frames, with each frame's depth;
    // and with that of a frame some way off, and the better of the two neighbours'.
    double own = 0.0;
    Rival exchanged, beside;
    bool exchangeable = false;  // they differ from frame to frame
    bool beside_is_next = false;
    // One map for all frames, in which things stand, though the camera moves past them. (A road
    // plane is one map too, and means it.)
    bool one_for_all = false;
    // The given depth is a plane: a guess, and by its shape neither disparity nor turned.
    bool is_plane = false;
    // The same on some frames, each after a short fit: with the given depth, with one depth
    // everywhere, with inverse depth in place of depth, and with the maps mirrored or upside down.
    // Without agreement where coarse edges show already that it is less.
    double refitted = 0.0;
    Rival none, inverse, mirrored, upside_down;
    double parallax_px = 0.0;  // what the depths from 5 to 95 % move [px at 640 px of width]
    double relief = 0.0;       // the range from 5 to 95 % of inverse depths, over their median
};
DepthCheck check_depth(const WorkingImages& images, const Rig& rig, const DepthRange& depths,
                       const Plan& plan);

// What is wrong with the depth; none where nothing is seen to be.
std::optional<Objection> wrong_depth(const DepthCheck& check);

}  // namespace xcalib

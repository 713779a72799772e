// Depth known as r only, D = 1 / (a r + b): what images and cameras determine of a and b.
//
// By Eq. (3d_mapping), pi(K_S R K_R^-1 x~ + (a r + b) K_S t), a is a gauge with t: a c and t / c
// give the same mapping. And so is b, as long as the source's intrinsics are free:
//     K_S R K_R^-1 x~ + b K_S t = K_S (R + b t e3^T) K_R^-1 x~,
// and any K_S (R + b t e3^T) is again an upper triangle times a rotation.
#pragma once

#include "solve/working_images.hpp"

namespace xcalib {

// The rig that maps depth 1 / (1 / D + shift) as `rig` maps D [shift in 1/m].
Rig with_shifted_depth(const Rig& rig, double shift);

// The same images with that depth.
WorkingImages with_shifted_depth(const WorkingImages& images, double shift);

// How far to shift the depth so that the equivalent rig has the most ordinary source camera:
// principal point near the middle, square pixels, no skew, and a shift that is not large against
// `farthest`, the inverse depth of what is far [1/m].
double ordinary_shift(const Rig& rig, double farthest);

// Where the source camera is known, the images determine it: the shift at which the rig, solved
// anew for each, aligns most edges. `rig` is replaced by the best.
double best_shift(const WorkingImages& images, const Plan& plan, double farthest, Rig& rig);

// Inverse depth that all but the farthest 2 % of what is known exceed [1/m].
double farthest_inverse_depth(const WorkingImages& images);

}  // namespace xcalib

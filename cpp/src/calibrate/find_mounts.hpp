// Mounts that footage may have been taken with, where upright does not fit.
#pragma once

#include <vector>

#include "solve/working_images.hpp"
#include "xcalib/mount.hpp"

namespace xcalib {

// The images as if the sources had been flipped left to right.
WorkingImages with_mirrored_sources(const WorkingImages& images);

// At most `count` mounts, the likeliest first, by a coarse search over every roll, mirrored and
// not; upright is not among them. `reference` and `source` give the sizes of the cameras.
std::vector<Mount> find_mounts(const WorkingImages& images, const ImageView& reference,
                               const ImageView& source, const Plan& plan, std::size_t count);

}  // namespace xcalib

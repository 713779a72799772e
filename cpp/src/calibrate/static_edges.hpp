// What stands still in the reference images while the scene changes: burnt-in text, a frame, a
// bonnet. Where the source has the same, it would pull the fit to itself.
#pragma once

#include "solve/working_images.hpp"

namespace xcalib {

// The same images without those edges: they have no depth any more, and the search does not see
// them. `share`: of the references' edges that were left out. Nothing is where there are fewer than
// 6 frames, or where so much stands still that the camera does.
WorkingImages without_static_edges(WorkingImages images, double& share);

// Do so many edges stay where they are that it is the camera that does not move?
bool camera_stands_still(const WorkingImages& images);

}  // namespace xcalib

// Depth of a video, averaged over time along the image flow; causal.
//
// What the last frame knew is carried to this one by the flow between their reference images
// (flow.hpp), and by one forward speed for the whole frame. A pixel goes on with the running mean
// of its inverse depth, or starts anew where depth or image around it has changed.
#pragma once

#include "xcalib/export.hpp"
#include "xcalib/image.hpp"

namespace XCALIB_EXPORT xcalib {

class DepthSteadier {
   public:
    // Frames are to follow on each other; any other one starts anew, and passes as it is. `depth`:
    // float32 [m], 0 unknown, which stays unknown; `reference`: its image, of any size of that
    // aspect. `num_threads`: 0 uses every core; the result does not depend on it.
    Image operator()(int index, const ImageView& depth, const ImageView& reference,
                     int num_threads = 0);

   private:
    int last_ = 0;
    Image inverse_, image_,
        count_;  // of the last frame: 1/m, the compressed image, frames averaged
};

}  // namespace xcalib

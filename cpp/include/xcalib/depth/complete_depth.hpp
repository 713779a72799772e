// From sparse or semi-dense depth to dense, along the edges of the reference image.
//
// Unknown pixels take the steady state of a diffusion of inverse depth, in which a plane is linear,
// from the known ones. It is reached coarse to fine: each level of a pyramid starts from the
// coarser one and needs a few relaxations only. Image edges conduct less, so depth rather changes
// there.
#pragma once

#include "xcalib/error.hpp"
#include "xcalib/export.hpp"
#include "xcalib/image.hpp"

namespace XCALIB_EXPORT xcalib {

// Filled pixels below it stay unknown, unless asked for.
inline constexpr double kCompletionConfidence = 0.3;

struct CompletedDepth {
    Image depth;       // [m], > 0 everywhere; known depth is kept as it is
    Image confidence;  // in [0, 1]: 1 where depth was known, and lower the farther a pixel is from
                       // known depth and the more depth varies around it; an order, no probability
};

// `depth`: one channel, float32 [m], 0 unknown; `guide`: the reference image, of any size of that
// aspect. Throws InputError where all is unknown, or the aspects differ.
CompletedDepth complete_depth(const ImageView& depth, const ImageView& guide);

// The same, with the pixels below this confidence left unknown; [0, 1], 0 fills everything.
Image completed(const ImageView& depth, const ImageView& guide,
                double min_confidence = kCompletionConfidence);

// The guide as gray of another size, with the contrast of dark parts raised, in [0, 1].
Image compressed_guide(const ImageView& guide, int width, int height);

}  // namespace xcalib

// Edges that may be averaged. Gradients of a reduced image are not those of its edges: of two
// modalities the fine edges coincide and the coarse shades do not. So edges are found at full size,
// drawn with the doubled angle, z = a exp(2 i theta), in which opposite directions are one and
// polarity drops out, and z is reduced in place of the image. Re conj(z_R) z_S = a b cos 2d is
// Eq. (nec) with 2 cos^2 d - 1 in place of |cos d|: zero on average where edges meet by chance.
#pragma once

#include <complex>
#include <vector>

#include "xcalib/export.hpp"
#include "xcalib/nec.hpp"

namespace XCALIB_EXPORT xcalib {

struct EdgeMap {
    int width = 0;
    int height = 0;
    std::vector<std::complex<float>> z;

    const std::complex<float>* row(int y) const {
        return z.data() + static_cast<std::size_t>(y) * width;
    }
};

// At the image's own size, halved until it is at most kEdgeMapWidth wide: nothing that reads it
// needs more.
inline constexpr int kEdgeMapWidth = 400;  // [px]
EdgeMap edge_map(const Image& image, float floor = kEdgeFloor);

// Averaged over the area of each new pixel (a side that would grow is left as it is), less the mean
// of some pixels around: what all edges of a region have in common does not show where it lies.
EdgeMap reduced(const EdgeMap& edges, int width, int height);

}  // namespace xcalib

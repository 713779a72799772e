// How alike two aligned images are. Images of one size; `valid` holds one byte a pixel, nonzero
// where valid, or is null for everywhere. A pixel counts where its whole stencil is valid; NaN
// where none does. The reference is gray; NEC is in nec.hpp.
#pragma once

#include <cstdint>
#include <vector>

#include "xcalib/export.hpp"
#include "xcalib/image.hpp"

namespace XCALIB_EXPORT xcalib {

// Gradient correlation: the mean over x and y of the zero-mean normalized correlation of the
// absolute forward differences. In [-1, 1].
double gc(const Image& reference, const Image& registered, const std::uint8_t* valid);

// Structural similarity (Wang et al. 2004): Gaussian window of sigma 1.5 px (11 x 11), K1 = 0.01,
// K2 = 0.03, sample covariance as published, `data_range` the span of the values, > 0. Throws
// std::invalid_argument.
double ssim(const Image& reference, const Image& registered, const std::uint8_t* valid,
            double data_range);

// Zero-mean normalized cross correlation. In [-1, 1].
double ncc(const Image& reference, const Image& registered, const std::uint8_t* valid);

// Root mean square error, in the images' unit.
double rmse(const Image& reference, const Image& registered, const std::uint8_t* valid);

// Peak signal-to-noise ratio [dB]: 20 log10(data_range / RMSE); infinite for equal images.
// Throws std::invalid_argument where `data_range` is not > 0.
double psnr(const Image& reference, const Image& registered, const std::uint8_t* valid,
            double data_range);

// What is left of the misalignment, measured with neither NEC nor the solver: on a grid of 48 x 48
// patches (step 32) of 6-bin unsigned orientation-energy maps, the shift within 14 px that has the
// best normalized correlation. Gray images in [0, 1], about 580 px wide.
struct PatchShift {
    float center_x, center_y;  // [px]
    float dx, dy;              // [px]: the registered image is displaced by this
};
std::vector<PatchShift> patch_residual(const Image& reference, const Image& registered,
                                       const std::uint8_t* valid, int num_threads = 0);

}  // namespace xcalib

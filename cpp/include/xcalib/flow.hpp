// Residual flow between a reference image and a source image, of another modality, that was warped
// to it: what is left of the misalignment, without weights and without the rig.
//
//     edge maps -> coarse to fine: warp by the flow so far, correlate patches, best shift -> both
//     ways -> confidence
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "xcalib/export.hpp"
#include "xcalib/image.hpp"

namespace XCALIB_EXPORT xcalib {

struct FlowOptions {
    int step = 7;    // [px] of the grid, odd: a vector stands on a pixel; >= 3
    int patch = 49;  // [px] side of a patch, an odd multiple of `step`; its rim counts less
    int levels = 3;  // of the pyramid, each half the size of the one before, >= 1; no coarser than
                     // two patches
    int max_shift = 24;  // [px] farthest shift that the coarsest level looks for, >= 1

    void validate() const;  // throws std::invalid_argument: field, value, range
};

// One vector for each whole cell of step x step reference pixels, at the cell's middle pixel
// (column * step + step / 2, row * step + step / 2).
// What reference pixel p shows is found at p + (x, y) in the warped source.
struct FlowField {
    int width = 0, height = 0;      // of the grid
    int step = 0;                   // [px] of the reference
    std::vector<float> x, y;        // [px]
    std::vector<float> confidence;  // in [0, 1]; 0 where it is unknown
};

// `reference` and `warped`: gray, of one size. `valid`: one byte a pixel, nonzero where the warped
// source is valid, or null for everywhere. `num_threads`: 0 uses every core; the result does not
// depend on it. Throws std::invalid_argument where sizes differ or the options are out of range.
// An image smaller than a patch has no confident vector; one smaller than a cell, no vector at all.
FlowField patch_flow(const Image& reference, const Image& warped, const std::uint8_t* valid,
                     const FlowOptions& options = {}, int num_threads = 0);

// Flow from a reference, gray and normalized, to the warped source, gray too; both in [0, 1] and of
// one size. `valid`: nonzero where the warped source is. Called from the calling thread.
using FlowEstimator = std::function<FlowField(const Image& reference, const Image& warped,
                                              const std::vector<std::uint8_t>& valid)>;

// One channel of a flow field at every pixel of a width x height image: linear between the grid's
// points, and as the nearest beyond them. `values` is one of the field's vectors.
Image at_every_pixel(const FlowField& field, const std::vector<float>& values, int width,
                     int height);

}  // namespace xcalib

// Normalized correlation of patches of edges at a row of shifts, for the instruction set that the
// machine has.
#pragma once

#include <cstddef>

namespace xcalib {

// From one pixel on: edges as vectors (x, y), their squared lengths, and how far a pixel counts.
struct EdgeRows {
    const float *x, *y, *square, *weight;
    std::size_t stride;  // [floats] from row to row, of each
};

// Patches around cells of step x step px; `profile` weighs the `cells` cells (odd) of a patch along
// one side, and is positive.
struct PatchGrid {
    int width, height, step;
    const float* profile;
    int cells;
};

constexpr float kNoCorrelation = -2.0f;

// Scores and what is read of an image beyond the last shift go to a multiple of so many.
constexpr int kShiftsAtOnce = 16;
constexpr int rounded_up(int shifts) {
    return (shifts + kShiftsAtOnce - 1) / kShiftsAtOnce * kShiftsAtOnce;
}

// For every patch of `a` and each of `shifts` shifts of `b` to the right, over the pixels that both
// images have:
//     sum w a . b_d / sqrt( sum w |a|^2 m_d  sum w m |b_d|^2 )
// or kNoCorrelation where these are too few. `b` can be read for the last shift rounded up to
// kShiftsAtOnce. `score` has the shifts (rounded up) of one cell after the other, row by row.
void correlate_patches(const EdgeRows& a, const EdgeRows& b, const PatchGrid& grid, int shifts,
                       float* score);

}  // namespace xcalib

// Gradients of a gray image, a row at a time, for the instruction set that the machine has.
#pragma once

#include <complex>

namespace xcalib {

// Three neighbouring rows of an image. Central differences: all but the first and last pixel have
// a gradient.
struct ImageRows {
    const float *above, *here, *below;
    int width;
};

// Sum of the gradients' magnitudes.
double sum_of_gradients(const ImageRows& rows);

// Gradient vectors n max(min(g, cap) - floor, 0). The first and last pixel are left as they are.
void clamped_gradients(const ImageRows& rows, float floor, float cap, float* x, float* y);

// Vectors a (cos t, sin t) with the angle doubled: a exp(2 i t).
void doubled_angles(const float* x, const float* y, int width, std::complex<float>* out);

}  // namespace xcalib

// The paper's parameters in one row, and how those of a rig move with them.
#pragma once

#include <Eigen/Core>

#include "xcalib/parameters.hpp"

namespace xcalib {

// The paper's unconstrained variables in one row: reference and source camera (fx, fy, cx, cy,
// skew), quaternion (w x y z), translation (x y z, by scales), and k1, k2 of the source.
enum PaperVariable : int {
    kPaperReference,
    kPaperSource = kPaperReference + 5,
    kPaperQuaternion = kPaperSource + 5,
    kPaperTranslation = kPaperQuaternion + 4,
    kPaperLens = kPaperTranslation + 9,
    kNumPaperVariables = kPaperLens + 2
};
using PaperVector = Eigen::Matrix<double, kNumPaperVariables, 1>;

PaperVector vector_of(const PaperParameters& parameters);
PaperParameters paper_of(const PaperVector& variables);

// d Parameter / d variables at the paper's parameters of a rig with these image sizes.
Eigen::Matrix<double, kNumParameters, kNumPaperVariables> paper_jacobian(
    const PaperParameters& parameters, const Rig& sizes);

}  // namespace xcalib

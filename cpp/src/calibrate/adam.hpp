// The paper's own solver: Adam on its parameterization, schedule and batches, with the costs and
// gradients of this library.
#pragma once

#include <functional>

#include "solve/working_images.hpp"
#include "xcalib/calibration_report.hpp"

namespace xcalib {

// The paper's unconstrained variables in one row: reference and source camera (fx, fy, cx, cy,
// skew), quaternion (w x y z), translation (x y z, by scales).
enum PaperVariable : int {
    kPaperReference,
    kPaperSource = kPaperReference + 5,
    kPaperQuaternion = kPaperSource + 5,
    kPaperTranslation = kPaperQuaternion + 4,
    kNumPaperVariables = kPaperTranslation + 9
};
using PaperVector = Eigen::Matrix<double, kNumPaperVariables, 1>;

PaperVector vector_of(const PaperParameters& parameters);
PaperParameters paper_of(const PaperVector& variables);

// d Parameter / d variables at the paper's parameters of a rig with these image sizes.
Eigen::Matrix<double, kNumParameters, kNumPaperVariables> paper_jacobian(
    const PaperParameters& parameters, const Rig& sizes);

// From `rig`, which is replaced; writes the report's steps and levels. `progress` gets the share
// of the steps taken.
void solve_adam(const WorkingImages& images, const Plan& plan,
                const std::function<void(double)>& progress, Rig& rig, CalibrationReport& report);

}  // namespace xcalib

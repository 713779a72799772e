// How far off a fit is expected to be, by place and depth.
//
// Two sources, neither of which knows the truth: how much each frame by itself would move the fit
// (the covariance of the normal equations, by their gradients), and how far two calibrations that
// share no frame lie apart. The first knows every direction in which a rig can move, among them
// the lens of its source where none was kept, the second every other thing that goes wrong.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calibrate/halves.hpp"
#include "solve/working_images.hpp"
#include "xcalib/error_field.hpp"
#include "xcalib/parameters.hpp"

namespace xcalib {

// The directions in which a rig may be off, by its parameters.
struct Directions {
    Parameters parameters = Parameters(0);
    Eigen::MatrixXd basis;  // parameters x directions: those that move together share one
    Eigen::VectorXd prior;  // what is known beforehand of each, inverse variances; mostly nothing
    Eigen::VectorXd held;   // 1 for a lens that the fit did not move, else 0

    Eigen::Index of(int parameter) const;  // -1 where it is held
};

class ErrorModel {
   public:
    // `finest`: the level of all images that the rig was solved at last.
    ErrorModel(const WorkingImages& images, const Level& finest, const Rig& rig,
               const Halves& halves, const Plan& plan);

    const ErrorField& field() const { return field_; }
    // Over the pixels of the footage at their own depths.
    ExpectedError over_footage() const;

    // What can slide, and with what, while the pixels of the footage move by a tenth of a pixel
    // (root mean square): "t_z by 4 cm, and fx by 1.1 % with it". Only what slides noticeably.
    std::vector<std::string> weak_directions() const;

   private:
    Directions directions_;
    ErrorField field_;
    Eigen::MatrixXd motion_;            // mean of J^T J by the directions over the footage [px^2]
    std::vector<double> over_footage_;  // deviations
};

}  // namespace xcalib

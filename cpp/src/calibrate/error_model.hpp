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
#include "xcalib/parameters.hpp"
#include "xcalib/verdict.hpp"

namespace xcalib {

// The directions in which a rig may be off, by its parameters.
struct Directions {
    Parameters parameters = Parameters(0);
    Eigen::MatrixXd basis;  // parameters x directions: those that move together share one
    Eigen::VectorXd prior;  // what is known beforehand of each, inverse variances; mostly nothing

    Eigen::Index of(int parameter) const;  // -1 where it is held
};

class ErrorModel {
   public:
    // `finest`: the level of all images that the rig was solved at last.
    ErrorModel(const WorkingImages& images, const Level& finest, const Rig& rig,
               const Halves& halves, const Plan& plan);

    // Of a pixel at a depth, along each axis [px of the reference when its width is 640 px].
    double deviation(double x, double y, double inverse_depth) const;

    // The length that `share` of the errors there do not exceed.
    double length(double x, double y, double inverse_depth, double share) const;

    // Whether the source sees a pixel at a depth.
    bool sees(double x, double y, double inverse_depth) const;
    const Rig& rig() const { return rig_; }

    // Over the places where the source sees something at this depth; infinite where there is none.
    ExpectedError at(double inverse_depth) const;
    // Over the pixels of the footage at their own depths.
    ExpectedError over_footage() const;

    // What can slide, and with what, while the pixels of the footage move by a tenth of a pixel
    // (root mean square): "t_z by 4 cm, and fx by 1.1 % with it". Only what slides noticeably.
    std::vector<std::string> weak_directions() const;

    // Standard deviation of a parameter, in its own unit; 0 where it is held.
    double deviation_of(int parameter) const;

   private:
    // dT by the directions.
    Eigen::MatrixXd jacobian_at(double x, double y, double depth) const;

    Rig rig_;
    Halves halves_;
    double unit_;          // to px of the reference at 640 px of width, from px of the source
    double floor_;         // [the same]
    double disagreement_;  // share of the halves' squared distance that the fit to all has
    Directions directions_;
    Eigen::VectorXd step_;              // to where the frames would have it, by the directions
    Eigen::MatrixXd covariance_;        // of them
    Eigen::MatrixXd motion_;            // mean of J^T J over the footage [px^2]
    std::vector<double> over_footage_;  // deviations
};

// Of errors whose axes have these deviations: half of them are no longer than the median.
ExpectedError expected_error(const std::vector<double>& deviations);

}  // namespace xcalib

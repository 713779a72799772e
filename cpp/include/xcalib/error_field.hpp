// How far off a rig is expected to be, at every place and depth.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "xcalib/camera.hpp"
#include "xcalib/export.hpp"
#include "xcalib/parameters.hpp"
#include "xcalib/verdict.hpp"

namespace XCALIB_EXPORT xcalib {

// What the errors are computed from, as numbers that can be stored. Lengths are in px of the
// reference when its width is 640 px.
struct ErrorField {
    Rig rig;
    std::vector<Rig> halves;    // two calibrations that share no frame, or none
    double unit = 1.0;          // to those px, from px of the source
    double floor = 0.0;         // what all frames share and nothing sees
    double disagreement = 0.0;  // share of the halves' squared distance that the fit to all has
    Parameters parameters = Parameters(0);  // that may be off
    Eigen::MatrixXd covariance;             // of them
    Eigen::VectorXd step;                   // of them, to where the frames would have the rig

    // Standard deviation along each axis, of a pixel at a depth; infinite without halves.
    double deviation(double x, double y, double inverse_depth) const;
    // The length that `share` of the errors there do not exceed.
    double length(double x, double y, double inverse_depth, double share) const;
    // Whether the source sees a pixel at a depth.
    bool sees(double x, double y, double inverse_depth) const;
    // Of a parameter, in its own unit; 0 where it is known.
    double deviation_of(int parameter) const;
    // d pixel of the source / d parameters.
    Eigen::MatrixXd jacobian(double x, double y, double depth) const;
    // Over the places where the source sees something at this depth; infinite where there is none.
    ExpectedError at(double inverse_depth) const;
};

// Of errors whose axes have these deviations: half of them are no longer than the median.
ExpectedError expected_error(const std::vector<double>& deviations);

}  // namespace xcalib

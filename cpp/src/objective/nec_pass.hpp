// The one pass over an image pair that the NEC and its normal equations are made of: warp,
// stencils, floor, polarity and derivatives, row by row, for the instruction set that the machine
// has.
#pragma once

#include <Eigen/Core>

#include "objective/work_times.hpp"
#include "xcalib/nec.hpp"

namespace xcalib {

// Pixels count whose whole stencil is valid. a n_R and v = b n_S are the clamped gradient vectors.
struct NecSums {
    double aa = 0;          // sum of |a n_R|^2
    double vv = 0;          // sum of |v|^2
    double av = 0;          // sum of |a n_R . v|
    double magnitudes = 0;  // sum of |a n_R| |v|
};
// `times`, if any, receives what it took.
NecSums nec_sums(const NecFrame& frame, const Rig& rig, WorkTimes* times = nullptr);

// Mean gradient magnitude of the warped source, where the whole stencil is valid.
float warped_mean_gradient(const NecFrame& frame, const Rig& rig);

// Rows of [dv/dp ..., v, s a n_R], two (x and y) for each pixel where the source has an edge; s is
// the polarity.
struct NecGram {
    NecSums sums;
    Eigen::MatrixXd gram;  // sum of the rows' outer products, to 1e-6 of the largest
};
// Where `rows` is given it receives the rows too, as its columns.
NecGram nec_gram(const NecFrame& frame, const Rig& rig, const Parameters& parameters,
                 WorkTimes* times = nullptr, Eigen::MatrixXd* rows = nullptr);

NecValue value_of(const NecFrame& frame, const NecSums& sums);

// The normal equations of 1 - A . V, A = a / ||a|| and V = v / ||v||, from the Gram matrix of the
// columns [dv/dp ..., v, a].
NecNormalEquations equations_from_gram(const Eigen::MatrixXd& gram, const NecValue& value);

}  // namespace xcalib

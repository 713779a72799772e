// The one pass over an image pair that the NEC and its normal equations are made of: warp,
// stencils, floor, polarity and derivatives, row by row, for the instruction set that the machine
// has.
#pragma once

#include <Eigen/Core>

#include "xcalib/nec.hpp"

namespace xcalib {

// Pixels count whose whole stencil is valid. a n_R and v = b n_S are the clamped gradient vectors.
struct NecSums {
    double aa = 0;          // sum of |a n_R|^2
    double vv = 0;          // sum of |v|^2
    double av = 0;          // sum of |a n_R . v|
    double magnitudes = 0;  // sum of |a n_R| |v|
};
NecSums nec_sums(const NecFrame& frame, const Rig& rig);

// Rows of [dv/dp (count), v, s a n_R], two (x and y) for each pixel where the source has an edge;
// s is the polarity. `count` is kNumWithoutReference or kNumParameters.
struct NecGram {
    double aa = 0, magnitudes = 0;
    Eigen::MatrixXd gram;  // sum of the rows' outer products, (count + 2)^2, lower triangle
};
// Where `rows` is given it receives the rows too, as its columns.
NecGram nec_gram(const NecFrame& frame, const Rig& rig, int count, Eigen::MatrixXd* rows = nullptr);

// The normal equations of 1 - A . V, A = a / ||a|| and V = v / ||v||, from the Gram matrix (all of
// it) of the columns [dv/dp ..., v, a].
NecNormalEquations equations_from_gram(const Eigen::MatrixXd& gram, const NecValue& value);

}  // namespace xcalib

// Normalized Edge Correlation, Eq. (nec), and why it is a least-squares problem.
//
// Let a = g'(I_R), b = g'(I_S') be the clamped gradient magnitudes, n the unit gradient directions,
// A = a / ||a||, B = b / ||b||, and s = sign(n_R . n_S) the polarity. With the residual
//     r = A n_R - s B n_S      (a 2-vector per pixel)
// half the sum of squares is exactly 1 - NEC: Gauss-Newton applies as it is.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "xcalib/camera.hpp"
#include "xcalib/export.hpp"
#include "xcalib/image.hpp"
#include "xcalib/parameters.hpp"

namespace XCALIB_EXPORT xcalib {

// Eq. (nec) with forward differences and Eq. (gradient_clamping), as the metric is published.
enum class NecFloor {
    none,     // upper clamp only: what the authors' code computes
    printed,  // the lower clamp 2 m / r too, as the formula is printed
};
// `valid`: one byte a pixel, nonzero where valid, or null for everywhere. A pixel counts where its
// whole stencil is valid. NaN where no edge is left.
double nec(const Image& reference, const Image& registered, const std::uint8_t* valid,
           NecFloor floor = NecFloor::none);

// The objective's limits, in mean magnitudes m. A floor of m and the cap at 5 m of
// Eq. (gradient_clamping) leave 1.8 times the end-point error on hard rendered rigs: many middling
// edges place a rig better than few strong ones.
inline constexpr float kEdgeFloor = 0.3f, kEdgeCap = 2.0f;

// Gradient vectors within them, n max(min(g, cap m) - floor m, 0): noise is ignored, and there is
// no step where edges begin to count.
struct EdgeField {
    int width = 0;
    int height = 0;
    std::vector<float> x, y;
};
EdgeField edge_field(const Image& image, float mean_magnitude, float floor = kEdgeFloor);

// Mean gradient magnitude m.
float mean_gradient(const Image& image);

// One pair of the objective at one pyramid level. Everything is held but the rig.
struct NecFrame {
    EdgeField reference;  // zero where depth is unknown
    Image depth;          // on the reference's grid [m]
    Image source;
    float source_mean = 0.0f;       // m of the warped source, held through a level
    float floor = kEdgeFloor;       // in mean magnitudes
    double reference_energy = 0.0;  // sum of |reference|^2

    // Where it is unknown, the reference has no edges any more.
    void set_depth(Image known);
};

NecFrame make_nec_frame(const Image& reference, const Image& source, const Image& depth,
                        const Rig& rig, float floor = kEdgeFloor);

struct NecValue {
    double nec = 0.0;          // in [0, 1]; 0 where no edges overlap
    double norm = 0.0;         // c_i, Eq. (nec_coefficient)
    double aligned = 0.0;      // NEC beyond what unrelated directions give, in (-inf, 1]
    double valid_share = 0.0;  // share of the reference's edge energy that the source covers
};

// `rig` must have the frame's sizes.
NecValue evaluate_nec(const NecFrame& frame, const Rig& rig);

// Gauss-Newton for 1 - NEC of one pair, by the parameters that were asked for, in their order.
struct NecNormalEquations {
    NecValue value;
    Eigen::MatrixXd hessian;   // J^T J
    Eigen::VectorXd gradient;  // J^T r
};
// To 1e-6 of what would be had by doubles throughout; the others cost nothing.
NecNormalEquations nec_normal_equations(const NecFrame& frame, const Rig& rig,
                                        const Parameters& parameters);

// The rows themselves, for tests and small images only: r and J, two rows for each pixel where both
// images are sampled and the source has an edge, and one row for all that is left of the
// reference's.
struct NecRows {
    Eigen::VectorXd residuals;
    Eigen::MatrixXd jacobian;
};
NecRows nec_rows(const NecFrame& frame, const Rig& rig, const Parameters& parameters);

}  // namespace xcalib

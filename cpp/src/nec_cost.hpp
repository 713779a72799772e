// The only place that knows Ceres' cost interface.
#pragma once

#include <ceres/ceres.h>

#include "image_pair.hpp"
#include "xcalib/camera.hpp"

namespace xcalib {

// J^T J, J^T r and c = |r|^2 / 2 of any number of rows, as count + 1 rows that have the same:
//     H = V L V^T,  J' = L^(1/2) V^T,  r' = L^(-1/2) V^T g (pseudo-inverse),
//     and one row of zeros with residual sqrt(2 c - |r'|^2).
struct CompressedBlock {
    Eigen::MatrixXd jacobian;   // (count + 1) x count
    Eigen::VectorXd residuals;  // count + 1
};
CompressedBlock compress(const Eigen::MatrixXd& hessian, const Eigen::VectorXd& gradient,
                         double cost);

// weight (1 - agreement) of one image pair as a Ceres residual block. A pair whose valid share
// falls below `minimum_share` is charged for it, so that no fit wins by shrinking the overlap.
class NecCost : public ceres::CostFunction {
   public:
    NecCost(const ImagePair& pair, int source_width, int source_height, double weight,
            double minimum_share, bool with_reference);

    bool Evaluate(double const* const* parameters, double* residuals,
                  double** jacobians) const override;

    // The blocks in the order that Evaluate takes them.
    static std::vector<double*> blocks(SolverParameters& parameters);

   private:
    const ImagePair& pair_;
    int source_width_, source_height_;
    double weight_, minimum_share_;
    bool with_reference_;
};

// A rotation that may pan and tilt but not roll: stage 1 freezes the roll.
class PanTiltManifold : public ceres::Manifold {
   public:
    int AmbientSize() const override { return 4; }
    int TangentSize() const override { return 2; }
    bool Plus(const double* x, const double* delta, double* x_plus_delta) const override;
    bool PlusJacobian(const double* x, double* jacobian) const override;
    bool Minus(const double* y, const double* x, double* y_minus_x) const override;
    bool MinusJacobian(const double* x, double* jacobian) const override;

   private:
    ceres::QuaternionManifold quaternion_;
};

}  // namespace xcalib

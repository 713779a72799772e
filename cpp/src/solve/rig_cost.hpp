// What Ceres needs to know of a rig: costs of its parameters, and a manifold of its rotation.
#pragma once

#include <ceres/autodiff_manifold.h>
#include <ceres/ceres.h>

#include <vector>

#include "xcalib/camera.hpp"
#include "xcalib/parameters.hpp"

namespace xcalib {

// J^T J, J^T r and c = |r|^2 / 2 of any number of rows, as count + 1 rows that have the same:
//     H = S V L V^T S,  J' = L^(1/2) V^T S,  r' = L^(-1/2) V^T S^-1 g (pseudo-inverse),
//     S = diag(H)^(1/2), and one row of zeros with residual sqrt(2 c - |r'|^2).
struct CompressedBlock {
    Eigen::MatrixXd jacobian;   // (count + 1) x count
    Eigen::VectorXd residuals;  // count + 1
};
CompressedBlock compress(const Eigen::MatrixXd& hessian, const Eigen::VectorXd& gradient,
                         double cost);

// A cost of all the parameters of a rig, which comes as normal equations.
class RigCost : public ceres::CostFunction {
   public:
    bool Evaluate(double const* const* parameters, double* residuals,
                  double** jacobians) const final;

    // The blocks in the order that Evaluate takes them.
    static std::vector<double*> blocks(SolverParameters& parameters);

   protected:
    // `rest`: the image sizes, lenses and whatever else is no parameter of the rigs that `cost` and
    // `linearized` get. `free`: what the solver may move, beyond which nothing is differentiated.
    RigCost(const Rig& rest, const Parameters& free);

    virtual double cost(const Rig& rig) const = 0;
    virtual CompressedBlock linearized(const Rig& rig, const Parameters& free) const = 0;

   private:
    Rig rest_;
    Parameters free_;
    // The last linearization and where it was: Ceres calls each block from one thread at a time,
    // and asks twice at the last place.
    mutable std::vector<double> last_at_;
    mutable CompressedBlock last_;
};

// Two numbers that move by the same.
struct MoveTogether {
    template <class T>
    bool Plus(const T* x, const T* delta, T* x_plus_delta) const {
        for (int i = 0; i < 2; ++i) x_plus_delta[i] = x[i] + delta[0];
        return true;
    }
    template <class T>
    bool Minus(const T* y, const T* x, T* y_minus_x) const {
        y_minus_x[0] = 0.5 * (y[0] - x[0] + y[1] - x[1]);
        return true;
    }
};
using TogetherManifold = ceres::AutoDiffManifold<MoveTogether, 2, 1>;

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

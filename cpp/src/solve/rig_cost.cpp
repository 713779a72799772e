#include "solve/rig_cost.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace xcalib {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Where each block's columns begin in the order of `Parameter`, and its size there.
struct Block {
    int first, tangent, ambient;
};
constexpr Block kBlocks[] = {{kSourceLogFx, 2, 2}, {kSourceCx, 2, 2},      {kSourceSkew, 1, 1},
                             {kRotationX, 3, 4},   {kTranslationX, 3, 3},  {kReferenceLogFx, 2, 2},
                             {kReferenceCx, 2, 2}, {kReferenceSkew, 1, 1}, {kSourceK1, 2, 2}};
constexpr int kRotationBlock = 3;
constexpr int kNumBlocks = 9;

}  // namespace

CompressedBlock compress(const Eigen::MatrixXd& hessian, const Eigen::VectorXd& gradient,
                         double cost) {
    const Eigen::Index count = hessian.rows();
    // In units in which every parameter bends the cost alike: what is lost by rounding is then a
    // share of each, not of the greatest.
    const Eigen::VectorXd unit = hessian.diagonal().unaryExpr(
        [](double curvature) { return curvature > 0 ? std::sqrt(curvature) : 1.0; });
    const Eigen::VectorXd inverse = unit.cwiseInverse();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(inverse.asDiagonal() * hessian *
                                                               inverse.asDiagonal());
    const Eigen::VectorXd& values = eigen.eigenvalues();
    const Eigen::MatrixXd& vectors = eigen.eigenvectors();
    // Eigenvalues below the rounding of sums of floats carry no direction: g has no part there
    // either.
    const double smallest = values[count - 1] * 1e-8;
    CompressedBlock block;
    block.jacobian = Eigen::MatrixXd::Zero(count + 1, count);
    block.residuals = Eigen::VectorXd::Zero(count + 1);
    for (Eigen::Index i = 0; i < count; ++i) {
        if (!(values[i] > smallest)) continue;
        const double root = std::sqrt(values[i]);
        block.jacobian.row(i) = root * vectors.col(i).cwiseProduct(unit).transpose();
        block.residuals[i] = vectors.col(i).cwiseProduct(inverse).dot(gradient) / root;
    }
    block.residuals[count] =
        std::sqrt(std::max(0.0, 2 * cost - block.residuals.head(count).squaredNorm()));
    return block;
}

RigCost::RigCost(const Rig& sizes, const Parameters& free) : rest_(sizes), free_(free) {
    for (const Block& block : kBlocks) mutable_parameter_block_sizes()->push_back(block.ambient);
    set_num_residuals(free.size() + 1);
}

std::vector<double*> RigCost::blocks(SolverParameters& p) {
    return {p.source.log_f,     p.source.center,        p.source.skew_share,
            p.quaternion,       p.translation,          p.reference.log_f,
            p.reference.center, p.reference.skew_share, p.source_lens};
}

bool RigCost::Evaluate(double const* const* parameters, double* residuals,
                       double** jacobians) const {
    SolverParameters p;
    const std::vector<double*> targets = blocks(p);
    for (int b = 0; b < kNumBlocks; ++b) std::copy_n(parameters[b], kBlocks[b].ambient, targets[b]);
    const Rig rig = rig_from_solver(p, rest_);
    const int count = num_residuals() - 1;
    if (!jacobians) {
        std::fill_n(residuals, count, 0.0);
        residuals[count] = std::sqrt(2 * cost(rig));
        return true;
    }
    std::vector<double> at;
    for (int b = 0; b < kNumBlocks; ++b)
        at.insert(at.end(), parameters[b], parameters[b] + kBlocks[b].ambient);
    if (at != last_at_) {
        last_ = linearized(rig, free_);
        last_at_ = at;
    }
    const CompressedBlock& block = last_;
    std::copy_n(block.residuals.data(), count + 1, residuals);
    RowMajor all = RowMajor::Zero(count + 1, kNumParameters);
    for (int i = 0; i < count; ++i) all.col(free_[i]) = block.jacobian.col(i);
    for (int b = 0; b < kNumBlocks; ++b) {
        if (!jacobians[b]) continue;
        Eigen::Map<RowMajor> out(jacobians[b], count + 1, kBlocks[b].ambient);
        const auto columns = all.middleCols(kBlocks[b].first, kBlocks[b].tangent);
        if (b != kRotationBlock) {
            out = columns;
            continue;
        }
        // Ceres multiplies by dPlus/ddelta, whose columns are orthonormal at a unit quaternion, and
        // its delta is half the rotation vector: dr/dq = dr/dw 2 (dPlus/ddelta)^T does the reverse.
        Eigen::Matrix<double, 4, 3, Eigen::RowMajor> plus;
        ceres::QuaternionManifold().PlusJacobian(parameters[b], plus.data());
        out = 2 * columns * plus.transpose();
    }
    return true;
}

bool PanTiltManifold::Plus(const double* x, const double* delta, double* x_plus_delta) const {
    const double full[3] = {delta[0], delta[1], 0.0};
    return quaternion_.Plus(x, full, x_plus_delta);
}

bool PanTiltManifold::PlusJacobian(const double* x, double* jacobian) const {
    Eigen::Matrix<double, 4, 3, Eigen::RowMajor> full;
    if (!quaternion_.PlusJacobian(x, full.data())) return false;
    Eigen::Map<Eigen::Matrix<double, 4, 2, Eigen::RowMajor>> out(jacobian);
    out = full.leftCols<2>();
    return true;
}

bool PanTiltManifold::Minus(const double* y, const double* x, double* y_minus_x) const {
    double full[3];
    if (!quaternion_.Minus(y, x, full)) return false;
    std::copy_n(full, 2, y_minus_x);
    return true;
}

bool PanTiltManifold::MinusJacobian(const double* x, double* jacobian) const {
    Eigen::Matrix<double, 3, 4, Eigen::RowMajor> full;
    if (!quaternion_.MinusJacobian(x, full.data())) return false;
    Eigen::Map<Eigen::Matrix<double, 2, 4, Eigen::RowMajor>> out(jacobian);
    out = full.topRows<2>();
    return true;
}

}  // namespace xcalib

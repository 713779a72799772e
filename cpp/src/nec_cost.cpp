#include "nec_cost.hpp"

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
constexpr Block kBlocks[] = {{kSourceLogFx, 2, 2}, {kSourceCx, 2, 2},     {kSourceSkew, 1, 1},
                             {kRotationX, 3, 4},   {kTranslationX, 3, 3}, {kReferenceLogFx, 2, 2},
                             {kReferenceCx, 2, 2}, {kReferenceSkew, 1, 1}};
constexpr int kRotationBlock = 3;
constexpr int kNumBlocks = 8;

}  // namespace

CompressedBlock compress(const Eigen::MatrixXd& hessian, const Eigen::VectorXd& gradient,
                         double cost) {
    const Eigen::Index count = hessian.rows();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(hessian);
    const Eigen::VectorXd& values = eigen.eigenvalues();
    const Eigen::MatrixXd& vectors = eigen.eigenvectors();
    // Eigenvalues below rounding carry no direction: g has no part there either.
    const double smallest = values[count - 1] * 1e-14;
    CompressedBlock block;
    block.jacobian = Eigen::MatrixXd::Zero(count + 1, count);
    block.residuals = Eigen::VectorXd::Zero(count + 1);
    for (Eigen::Index i = 0; i < count; ++i) {
        if (!(values[i] > smallest)) continue;
        const double root = std::sqrt(values[i]);
        block.jacobian.row(i) = root * vectors.col(i).transpose();
        block.residuals[i] = vectors.col(i).dot(gradient) / root;
    }
    block.residuals[count] =
        std::sqrt(std::max(0.0, 2 * cost - block.residuals.head(count).squaredNorm()));
    return block;
}

NecCost::NecCost(const ImagePair& pair, int source_width, int source_height, double weight,
                 double minimum_share, bool with_reference)
    : pair_(pair), source_width_(source_width), source_height_(source_height), weight_(weight),
      minimum_share_(minimum_share), with_reference_(with_reference) {
    for (const Block& block : kBlocks) mutable_parameter_block_sizes()->push_back(block.ambient);
    set_num_residuals((with_reference ? kNumParameters : kNumWithoutReference) + 1);
}

std::vector<double*> NecCost::blocks(SolverParameters& p) {
    return {p.source.log_f, p.source.center,   p.source.skew,      p.quaternion,
            p.translation,  p.reference.log_f, p.reference.center, p.reference.skew};
}

bool NecCost::Evaluate(double const* const* parameters, double* residuals,
                       double** jacobians) const {
    SolverParameters p;
    const std::vector<double*> targets = blocks(p);
    for (int b = 0; b < kNumBlocks; ++b) std::copy_n(parameters[b], kBlocks[b].ambient, targets[b]);
    const Rig rig = rig_from_solver(p, pair_.depth().width, pair_.depth().height, source_width_,
                                    source_height_);
    const auto cost_of = [this](const NecValue& value) {
        constexpr double kChargeForOverlap = 10.0;
        const double missing = std::max(0.0, minimum_share_ - value.valid_share);
        return weight_ * (1 - value.nec + kChargeForOverlap * missing * missing);
    };
    const int count = num_residuals() - 1;
    if (!jacobians) {
        std::fill_n(residuals, count, 0.0);
        residuals[count] = std::sqrt(2 * cost_of(pair_.evaluate(rig)));
        return true;
    }
    const NecNormalEquations equations =
        pair_.normal_equations(rig, with_reference_ ? kNumParameters : kNumWithoutReference);
    // With any amplitude k, r = A / sqrt(k) - s sqrt(k) B has the same cost up to a constant and
    // the same gradient, and k J^T J for a Hessian. Only edges that have a partner bend the cost,
    // so the k that predicts it is their share, not 1: about half of what direction alone shows to
    // be aligned, since some edges coincide by chance. Each step is still tested by its cost. Below
    // g^T H^+ g / 2c the block could not carry the cost.
    const double cost = cost_of(equations.value);
    CompressedBlock block = compress(weight_ * equations.hessian, weight_ * equations.gradient, 0);
    const double explained = block.residuals.squaredNorm();  // g^T H^+ g
    const double amplitude =
        std::max(0.5 * std::max(equations.value.aligned, 0.1), explained / (2 * cost));
    block.jacobian *= std::sqrt(amplitude);
    block.residuals /= std::sqrt(amplitude);
    block.residuals[count] = std::sqrt(std::max(0.0, 2 * cost - explained / amplitude));
    std::copy_n(block.residuals.data(), count + 1, residuals);
    for (int b = 0; b < kNumBlocks; ++b) {
        if (!jacobians[b]) continue;
        Eigen::Map<RowMajor> out(jacobians[b], count + 1, kBlocks[b].ambient);
        if (kBlocks[b].first >= count) {
            out.setZero();
            continue;
        }
        const auto columns = block.jacobian.middleCols(kBlocks[b].first, kBlocks[b].tangent);
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

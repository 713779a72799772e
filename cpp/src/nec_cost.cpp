#include "nec_cost.hpp"

#include <algorithm>
#include <cmath>

namespace xcalib {

ceres::CallbackReturnType Curvature::operator()(const ceres::IterationSummary& step) {
    if (step.iteration > 0 && step.step_is_successful) {
        const double judged = used_;
        used_ = next_;
        next_ = std::clamp(judged * std::max(0.5, 2 - step.relative_decrease), 0.1, 1.0);
    }
    return ceres::SOLVER_CONTINUE;
}

double NecCost::cost_of(const NecValue& value) const {
    constexpr double kChargeForOverlap = 10.0;
    const double missing = std::max(0.0, minimum_share_ - value.valid_share);
    return weight_ * (1 - value.nec + kChargeForOverlap * missing * missing);
}

CompressedBlock NecCost::linearized(const Rig& rig, const Parameters& free) const {
    const NecNormalEquations equations = pair_.normal_equations(rig, free);
    // With any amplitude k, r = A / sqrt(k) - s sqrt(k) B has the same cost up to a constant and
    // the same gradient, and k J^T J for a Hessian. Only edges that have a partner bend the cost,
    // so the k that predicts it is their share, not 1: about half of what direction alone shows to
    // be aligned, since some edges coincide by chance. Each step is still tested by its cost. Below
    // g^T H^+ g / 2c the block could not carry the cost.
    const double cost = cost_of(equations.value);
    CompressedBlock block = compress(weight_ * equations.hessian, weight_ * equations.gradient, 0);
    const double explained = block.residuals.squaredNorm();  // g^T H^+ g
    const double amplitude = std::max(
        0.5 * std::max(equations.value.aligned, 0.1) * curvature_.share(), explained / (2 * cost));
    block.jacobian *= std::sqrt(amplitude);
    block.residuals /= std::sqrt(amplitude);
    block.residuals[free.size()] = std::sqrt(std::max(0.0, 2 * cost - explained / amplitude));
    return block;
}

}  // namespace xcalib

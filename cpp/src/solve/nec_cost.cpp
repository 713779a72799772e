#include "solve/nec_cost.hpp"

#include <algorithm>
#include <cmath>

namespace xcalib {

double NecCost::cost_of(const NecValue& value) const {
    constexpr double kChargeForOverlap = 10.0;
    const double missing = std::max(0.0, minimum_share_ - value.valid_share);
    return weight_ * (1 - value.nec + kChargeForOverlap * missing * missing);
}

CompressedBlock NecCost::linearized(const Rig& rig, const Parameters& free) const {
    const NecNormalEquations equations = pair_.normal_equations(rig, free);
    // With any amplitude k, r = A / sqrt(k) - s sqrt(k) B has the same cost up to a constant and
    // the same gradient, and k J^T J for a Hessian. The k that predicts the cost is the pair's
    // `curvature`, not 1. Each step is still tested by its cost. Below g^T H^+ g / 2c the block
    // could not carry the cost.
    const double cost = cost_of(equations.value);
    CompressedBlock block = compress(weight_ * equations.hessian, weight_ * equations.gradient, 0);
    const double explained = block.residuals.squaredNorm();  // g^T H^+ g
    const double amplitude =
        std::max({pair_.curvature(equations.value), 0.01, explained / (2 * cost)});
    block.jacobian *= std::sqrt(amplitude);
    block.residuals /= std::sqrt(amplitude);
    block.residuals[free.size()] = std::sqrt(std::max(0.0, 2 * cost - explained / amplitude));
    return block;
}

}  // namespace xcalib

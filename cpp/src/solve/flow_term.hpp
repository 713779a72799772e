// The flow term, Eq. (flow_loss): residual flow between the images as correspondences, which are
// held while the solver moves.
//
//     rig -> warp -> flow F -> reference pixel x belongs at source point T(x + F(x))
//
// To first order the gradient of sum |T(x; p) - T(x + F)| is that of the paper's mean |F|, without
// a derivative of whatever estimates F.
#pragma once

#include <vector>

#include "solve/rig_cost.hpp"
#include "solve/working_images.hpp"
#include "xcalib/flow.hpp"

namespace xcalib {

constexpr int kFlowCell = 7;  // [px] a side, of which one vector is taken

struct FlowTarget {
    float x, y, depth;  // reference pixel, and its depth [m]
    float u, v;         // source point [px]
    float weight;       // > 0; over all pairs they sum to 1 at most
};

// Those of one image pair.
struct FlowTargets {
    Rig rig;  // that the flow was estimated at, with the sizes of the images
    std::vector<FlowTarget> targets;
};

// The flow term and its Gauss-Newton, by the given parameters:
//     sum of weight (sqrt(e^2 + s^2) - s),  e = |T(x; p) - (u, v)| f_R / f_S / (w_R / 2)
// The unit is half the width of the reference, in which a misalignment costs with lambda = 2.5
// about what it takes from the NEC; s is a pixel of 640.
struct FlowEquations {
    double value = 0.0;
    Eigen::MatrixXd hessian;
    Eigen::VectorXd gradient;
};
double flow_value(const FlowTargets& targets, const Rig& rig);
FlowEquations flow_equations(const FlowTargets& targets, const Rig& rig,
                             const Parameters& parameters);

// weight times the above as a cost for Ceres.
class FlowCost : public RigCost {
   public:
    FlowCost(const FlowTargets& targets, double weight, const Parameters& free)
        : RigCost(targets.rig, free), targets_(targets), weight_(weight) {}

   private:
    double cost(const Rig& rig) const override { return weight_ * flow_value(targets_, rig); }
    CompressedBlock linearized(const Rig& rig, const Parameters& free) const override;

    const FlowTargets& targets_;
    double weight_;
};

// One for each pair, estimated at a level of the pyramid, where `rig` is now. No estimator: the
// patch flow, which looks for shifts up to `max_shift` [px of the level].
std::vector<FlowTargets> estimate_flow(const WorkingImages& images, int factor, const Rig& rig,
                                       const FlowEstimator& estimator, int max_shift,
                                       int num_threads);

}  // namespace xcalib

// 1 - NEC of one image pair as a cost for Ceres.
#pragma once

#include "image_pair.hpp"
#include "rig_cost.hpp"

namespace xcalib {

// How much of what the linearization tells of the cost's curvature there is. Where few edges have a
// partner it bends far less, and every step would fall short. Each step shows by how much: of a
// quadratic of h times the curvature it lowers 2 - h times what was predicted.
class Curvature : public ceres::IterationCallback {
   public:
    double share() const { return next_; }
    ceres::CallbackReturnType operator()(const ceres::IterationSummary& step) override;

   private:
    // Of the linearization that the step judged last began at, and of those to come. Between them
    // is one: the solver linearizes where it arrived before it tells how it got there.
    double used_ = 1.0, next_ = 1.0;
};

// weight (1 - agreement). A pair whose valid share falls below `minimum_share` is charged for it,
// so that no fit wins by shrinking the overlap. `sizes`: a rig of the level's image sizes.
class NecCost : public RigCost {
   public:
    NecCost(const ImagePair& pair, const Rig& sizes, double weight, double minimum_share,
            const Parameters& free, const Curvature& curvature)
        : RigCost(sizes, free), pair_(pair), weight_(weight), minimum_share_(minimum_share),
          curvature_(curvature) {}

   private:
    double cost(const Rig& rig) const override { return cost_of(pair_.evaluate(rig)); }
    CompressedBlock linearized(const Rig& rig, const Parameters& free) const override;
    double cost_of(const NecValue& value) const;

    const ImagePair& pair_;
    double weight_, minimum_share_;
    const Curvature& curvature_;
};

}  // namespace xcalib

// 1 - NEC of one image pair as a cost for Ceres.
#pragma once

#include "objective/image_pair.hpp"
#include "solve/rig_cost.hpp"

namespace xcalib {

// weight (1 - agreement). A pair whose valid share falls below `minimum_share` is penalised for it,
// so that no fit wins by shrinking the overlap. `sizes`: a rig of the level's image sizes.
class NecCost : public RigCost {
   public:
    NecCost(const ImagePair& pair, const Rig& sizes, double weight, double minimum_share,
            const Parameters& free)
        : RigCost(sizes, free), pair_(pair), weight_(weight), minimum_share_(minimum_share) {}

   private:
    double cost(const Rig& rig) const override { return cost_of(pair_.evaluate(rig)); }
    CompressedBlock linearized(const Rig& rig, const Parameters& free) const override;
    double cost_of(const NecValue& value) const;

    const ImagePair& pair_;
    double weight_, minimum_share_;
};

}  // namespace xcalib

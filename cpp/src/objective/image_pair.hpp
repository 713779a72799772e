// A pair of images at one level, as the solver sees it: something that is compared through a rig.
#pragma once

#include <algorithm>
#include <memory>

#include "objective/nec_pass.hpp"
#include "objective/work_times.hpp"
#include "xcalib/edge_map.hpp"
#include "xcalib/nec.hpp"

namespace xcalib {

class ImagePair {
   public:
    virtual ~ImagePair() = default;
    // `rig` must have the level's sizes.
    virtual NecValue evaluate(const Rig& rig) const = 0;
    // Gauss-Newton for 1 - evaluate(rig).nec.
    virtual NecNormalEquations normal_equations(const Rig& rig,
                                                const Parameters& parameters) const = 0;
    virtual const Image& depth() const = 0;  // on the reference's grid [m]
    // The same images with other depth, which is compared only where this one is known too.
    virtual std::shared_ptr<const ImagePair> with_depth(Image depth) const = 0;
    // The share of the normal equations' curvature that the cost has: only edges with a partner
    // bend it. As it was measured, by what steps lowered the cost by and what they were to.
    virtual double curvature(const NecValue& at) const = 0;

    std::shared_ptr<WorkTimes> times;  // receives, if any, what the above take
};

// Eq. (nec).
class NecPair : public ImagePair {
   public:
    explicit NecPair(NecFrame frame) : frame_(std::move(frame)) {}
    NecValue evaluate(const Rig& rig) const override {
        return value_of(frame_, nec_sums(frame_, rig, times.get()));
    }
    NecNormalEquations normal_equations(const Rig& rig,
                                        const Parameters& parameters) const override {
        const NecGram pass = nec_gram(frame_, rig, parameters, times.get());
        return equations_from_gram(pass.gram, value_of(frame_, pass.sums));
    }
    const Image& depth() const override { return frame_.depth; }
    std::shared_ptr<const ImagePair> with_depth(Image depth) const override {
        auto out = std::make_shared<NecPair>(*this);
        out->frame_.set_depth(std::move(depth));
        return out;
    }
    double curvature(const NecValue& at) const override {
        const double aligned = std::max(0.0, at.aligned);
        return std::min(0.5, 0.8 * aligned) * aligned;
    }

   private:
    NecFrame frame_;
};

// The normalized correlation of edge maps: with Z = z / ||z|| over the valid pixels,
// r = Z_R - Z_S and half the sum of squares is 1 minus it.
class EdgePair : public ImagePair {
   public:
    EdgePair(EdgeMap reference, EdgeMap source, Image depth);
    NecValue evaluate(const Rig& rig) const override;
    NecNormalEquations normal_equations(const Rig& rig,
                                        const Parameters& parameters) const override;
    const Image& depth() const override { return depth_; }
    std::shared_ptr<const ImagePair> with_depth(Image depth) const override;
    double curvature(const NecValue& at) const override { return at.aligned; }

   private:
    void set_depth(Image depth);

    EdgeMap reference_, source_;
    Image depth_;
    double reference_energy_ = 0.0;
};

}  // namespace xcalib

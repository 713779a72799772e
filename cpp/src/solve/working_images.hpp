// The caller's frames as the calibration works on them, and their pyramid.
#pragma once

#include <map>
#include <memory>
#include <vector>

#include "objective/image_pair.hpp"
#include "solve/plan.hpp"

namespace xcalib {

// References and depths at one level of the pyramid: what no rig changes.
struct ReducedImages {
    std::vector<Image> references, depths;
    std::vector<EdgeMap> edges;  // of the references, at the coarse levels
};

struct WorkingImages {
    std::vector<Image> references;  // gray, normalized, reduced by a whole factor
    std::vector<Image> sources;     // gray, normalized, as large as given
    std::vector<EdgeMap> reference_edges, source_edges;
    std::map<int, ReducedImages> pyramid;  // by the factor of kFactors
    Parts parts;

    std::shared_ptr<WorkTimes> times = std::make_shared<WorkTimes>();  // of all pairs made of them

    std::size_t size() const { return references.size(); }
    // The pairs of these indices.
    WorkingImages subset(const std::vector<std::size_t>& indices) const;
    // `count` of them at most, spread over the footage: neighbours look alike.
    WorkingImages spread(std::size_t count) const;
};

inline constexpr int kFactors[] = {8, 4, 2, 1};
// From this factor on, edge maps are compared; the finer levels maximize the NEC itself.
inline constexpr int kCoarse = 4;

// Checks what was given, and throws naming the frame by its index in the caller's lists.
void validate_frames(const std::vector<ImageView>& references,
                     const std::vector<ImageView>& sources, const std::vector<ImageView>& depths);

WorkingImages make_working_images(const std::vector<ImageView>& references,
                                  const std::vector<ImageView>& sources,
                                  const std::vector<ImageView>& depths,
                                  const std::vector<int>& chosen, const Plan& plan);

// The same references and depths with other sources, one each, prepared as those were.
WorkingImages with_sources(const WorkingImages& images, const std::vector<ImageView>& sources,
                           int num_threads);

// Depth without its edges, for the NEC of the finer levels: across an edge, the warp joins two
// surfaces that the source camera may not see side by side, and the step between them moves with
// the depth, not with the rig. Coarser levels keep them, since nearly every pixel is near one
// there, and flow does, since its patches are wider.
Image without_depth_edges(const Image& depth);

// One level of the pyramid, made for the scale between the cameras that `rig` has.
struct Level {
    int factor = 1;
    int width = 0, height = 0;  // of the reference
    int source_width = 0, source_height = 0;
    std::vector<std::shared_ptr<const ImagePair>> pairs;
    std::vector<double> weights;  // c_i / sum c_i at `rig`

    Rig rig_at(const Rig& rig) const {
        return rig.resized(width, height, source_width, source_height);
    }
};
Level make_level(const WorkingImages& images, int factor, const Rig& rig, int num_threads);
// Its sizes only, for sources no finer than the reference.
Level make_sizes(const WorkingImages& images, int factor, const Rig& rig);
// The same with other depth maps of its size, one for each pair, and compared where its own are
// known too.
Level with_depths(const Level& level, const std::vector<Image>& depths,
                  const WorkingImages& images);
// Every `folds`-th pair of a level from `fold` on, or all but those.
Level fold_of(const Level& level, std::size_t folds, std::size_t fold, bool inside);
// The same with the NEC at any factor.
Level make_nec_level(const WorkingImages& images, int factor, const Rig& rig, int num_threads);

}  // namespace xcalib

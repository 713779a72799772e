#include "solve/working_images.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>

#include "base/parallel.hpp"
#include "xcalib/gray.hpp"

namespace xcalib {
namespace {

// Blur before bilinear sampling, which needs smooth images; more blur costs accuracy. [px]
constexpr double kBlur = 0.6;

// Source pixels to a reference pixel, in one direction, beyond which they are averaged before they
// are sampled. Edge maps are averages already; the NEC's edges are sharper for some aliasing.
constexpr double kEdgeDensity = 1.0, kNecDensity = 2.0;

std::string size_text(const ImageView& view) {
    return std::to_string(view.width) + "x" + std::to_string(view.height);
}

void require_one_size(const char* name, const std::vector<ImageView>& views) {
    for (std::size_t i = 0; i < views.size(); ++i) {
        const std::string frame = std::string(name) + " frame " + std::to_string(i);
        if (views[i].width < 32 || views[i].height < 32)
            throw std::invalid_argument(frame + " is " + size_text(views[i]) +
                                        ", expected at least 32x32");
        if (views[i].width != views[0].width || views[i].height != views[0].height)
            throw std::invalid_argument(frame + " is " + size_text(views[i]) + ", expected " +
                                        size_text(views[0]) + " as in frame 0");
    }
}

// Passes an error on with the frame that it belongs to.
template <class Work>
void for_frame(const char* name, int index, const Work& work) {
    try {
        work();
    } catch (const std::invalid_argument& error) {
        throw std::invalid_argument(std::string(name) + " frame " + std::to_string(index) + ": " +
                                    error.what());
    }
}

float floor_of(const Parts& parts) { return parts.floor ? kEdgeFloor : 0.0f; }

// Fills source `i`, which there must be a place for.
void prepare_source(const ImageView& source, int i, WorkingImages& images) {
    images.sources[i] = known_gray(source);
    if (images.parts.normalization) images.sources[i] = normalize_percentiles(images.sources[i]);
    images.source_edges[i] = edge_map(images.sources[i], floor_of(images.parts));
}

}  // namespace

void validate_frames(const std::vector<ImageView>& references,
                     const std::vector<ImageView>& sources, const std::vector<ImageView>& depths) {
    if (references.empty())
        throw std::invalid_argument("no image pairs were given, expected at least 1");
    if (references.size() != sources.size() || references.size() != depths.size())
        throw std::invalid_argument("got " + std::to_string(references.size()) + " references, " +
                                    std::to_string(sources.size()) + " sources and " +
                                    std::to_string(depths.size()) +
                                    " depth maps, expected as many of each");
    require_one_size("reference", references);
    require_one_size("source", sources);
    for (std::size_t i = 0; i < depths.size(); ++i)
        for_frame("depth", static_cast<int>(i), [&] {
            require_same_aspect("size", depths[i].width, depths[i].height, references[0].width,
                                references[0].height);
        });
}

Image without_depth_edges(const Image& depth) {
    constexpr float kEdge = 1.1f, kFar = std::numeric_limits<float>::max();
    const int width = depth.width;
    Image out = depth;
    // The nearest and farthest known depths of three rows, with a column more at both ends.
    std::vector<float> nearest(width + 2, kFar), farthest(width + 2, 0.0f);
    for (int y = 0; y < depth.height; ++y) {
        const float* rows[] = {depth.row(std::max(0, y - 1)), depth.row(y),
                               depth.row(std::min(depth.height - 1, y + 1))};
        float *near = nearest.data() + 1, *far = farthest.data() + 1;
        for (int x = 0; x < width; ++x) {
            const float a = rows[0][x], b = rows[1][x], c = rows[2][x];
            far[x] = std::max(a, std::max(b, c));
            near[x] = std::min(a > 0 ? a : kFar, std::min(b > 0 ? b : kFar, c > 0 ? c : kFar));
        }
        float* to = out.row(y);
        for (int x = 0; x < width; ++x) {
            const float here = rows[1][x];
            const float most = std::max(far[x - 1], std::max(far[x], far[x + 1]));
            const float least = std::min(near[x - 1], std::min(near[x], near[x + 1]));
            to[x] = most > here * kEdge || least * kEdge < here ? 0.0f : here;
        }
    }
    return out;
}

WorkingImages make_working_images(const std::vector<ImageView>& references,
                                  const std::vector<ImageView>& sources,
                                  const std::vector<ImageView>& depths,
                                  const std::vector<int>& chosen, const Plan& plan) {
    const Clock::time_point start = Clock::now();
    const CalibrationOptions& options = plan.options;
    const int reduction = (references[0].width + options.working_width - 1) / options.working_width;
    const int width = static_cast<int>(std::lround(references[0].width / double(reduction)));
    const int height = static_cast<int>(std::lround(references[0].height / double(reduction)));
    const std::size_t count = chosen.size();
    const float floor = floor_of(plan.parts);
    WorkingImages images;
    images.parts = plan.parts;
    images.references.resize(count);
    images.sources.resize(count);
    images.reference_edges.resize(count);
    images.source_edges.resize(count);
    for (int factor : kFactors)
        images.pyramid[factor] = {std::vector<Image>(count), std::vector<Image>(count),
                                  std::vector<EdgeMap>(factor >= kCoarse ? count : 0)};
    parallel_each(static_cast<int>(count), options.num_threads, [&](int i) {
        const int frame = chosen[i];
        for_frame("reference", frame, [&] {
            images.references[i] = resize_area(known_gray(references[frame]), width, height);
            if (plan.parts.normalization)
                images.references[i] = normalize_dark(images.references[i]);
        });
        for_frame("source", frame, [&] { prepare_source(sources[frame], i, images); });
        images.reference_edges[i] = edge_map(images.references[i], floor);
        Image depth;
        for_frame("depth", frame, [&] {
            depth = resize_depth(clean_depth(depths[frame]), width, height);
            const auto& d = depth.pixels;
            if (std::none_of(d.begin(), d.end(), [](float z) { return z > 0; }))
                throw std::invalid_argument(
                    "no depth is known, expected finite metres > 0 in some pixels");
        });
        for (auto& [factor, level] : images.pyramid) {
            const int w = std::max(1, static_cast<int>(std::lround(width / double(factor))));
            const int h = std::max(1, static_cast<int>(std::lround(height / double(factor))));
            level.references[i] = resize_area(images.references[i], w, h);
            level.depths[i] = resize_depth(depth, w, h);
            if (factor >= kCoarse) level.edges[i] = reduced(images.reference_edges[i], w, h);
        }
    });
    images.times->prepare += nanoseconds_since(start);
    return images;
}

WorkingImages with_sources(const WorkingImages& images, const std::vector<ImageView>& sources,
                           int num_threads) {
    const Clock::time_point start = Clock::now();
    WorkingImages out = images;
    parallel_each(static_cast<int>(images.size()), num_threads,
                  [&](int i) { prepare_source(sources[i], i, out); });
    images.times->prepare += nanoseconds_since(start);
    return out;
}

WorkingImages WorkingImages::subset(const std::vector<std::size_t>& indices) const {
    WorkingImages out;
    out.times = times;
    out.parts = parts;
    for (std::size_t i : indices) {
        out.references.push_back(references[i]);
        out.sources.push_back(sources[i]);
        out.reference_edges.push_back(reference_edges[i]);
        out.source_edges.push_back(source_edges[i]);
        for (const auto& [factor, level] : pyramid) {
            ReducedImages& target = out.pyramid[factor];
            target.references.push_back(level.references[i]);
            target.depths.push_back(level.depths[i]);
            if (factor >= kCoarse) target.edges.push_back(level.edges[i]);
        }
    }
    return out;
}

WorkingImages WorkingImages::spread(std::size_t count) const {
    count = std::min(count, size());
    std::vector<std::size_t> indices;
    for (std::size_t i = 0; i < count; ++i) indices.push_back(i * size() / count);
    return subset(indices);
}

namespace {

// Source pixels to a reference pixel at this level, along the width, if the source were so wide.
double density_at(const Level& level, int source_width, const Rig& rig) {
    const double source = source_width / static_cast<double>(rig.source.width);
    const double reference = level.width / static_cast<double>(rig.reference.width);
    return rig.source_density().x() * source / reference;
}

// A level without its pairs: its sizes, for sources of the given size at most.
Level level_for(const WorkingImages& images, int factor, int source_width, int source_height,
                double max_density, const Rig& rig) {
    Level level;
    level.factor = factor;
    const Image& depth = images.pyramid.at(factor).depths[0];
    level.width = depth.width;
    level.height = depth.height;
    const double shrink = std::max(1.0, density_at(level, source_width, rig) / max_density);
    level.source_width = std::max(8, static_cast<int>(std::lround(source_width / shrink)));
    level.source_height = std::max(8, static_cast<int>(std::lround(source_height / shrink)));
    return level;
}

// Fills the level with make_pair(index). Its time is all preparation, weights included.
template <class MakePair>
void fill(Level& level, const WorkingImages& images, const Rig& rig, int num_threads,
          const MakePair& make_pair) {
    const Clock::time_point start = Clock::now();
    const Rig at_level = level.rig_at(rig);
    const std::size_t count = images.size();
    level.pairs.resize(count);
    level.weights.resize(count);
    parallel_each(static_cast<int>(count), num_threads, [&](int i) {
        auto pair = make_pair(i);
        level.weights[i] = images.parts.pair_weights ? pair->evaluate(at_level).norm : 1.0;
        pair->times = images.times;
        level.pairs[i] = std::move(pair);
    });
    const double sum = std::accumulate(level.weights.begin(), level.weights.end(), 0.0);
    for (double& weight : level.weights)
        weight = sum > 0 ? weight / sum : 1.0 / static_cast<double>(count);
    images.times->prepare += nanoseconds_since(start);
}

}  // namespace

Level make_nec_level(const WorkingImages& images, int factor, const Rig& rig, int num_threads) {
    const Image& source = images.sources[0];
    Level level = level_for(images, factor, source.width, source.height, kNecDensity, rig);
    const double density = density_at(level, source.width, rig);
    const ReducedImages& reduced = images.pyramid.at(factor);
    // Where the reference is finer than its partner, it is blurred to match.
    const double reference_blur = kBlur * std::max(1.0, 1 / density);
    const Rig at_level = level.rig_at(rig);
    const bool whole = factor >= kCoarse || !images.parts.depth_edges;
    fill(level, images, rig, num_threads, [&](int i) {
        const Image& depth = reduced.depths[i];
        return std::make_unique<NecPair>(make_nec_frame(
            gaussian_blur(reduced.references[i], reference_blur),
            gaussian_blur(resize_area(images.sources[i], level.source_width, level.source_height),
                          kBlur),
            whole ? depth : without_depth_edges(depth), at_level, floor_of(images.parts)));
    });
    return level;
}

Level make_sizes(const WorkingImages& images, int factor, const Rig& rig) {
    const Image& source = images.sources[0];
    return level_for(images, factor, source.width, source.height, 1.0, rig);
}

Level make_level(const WorkingImages& images, int factor, const Rig& rig, int num_threads) {
    if (factor < kCoarse) return make_nec_level(images, factor, rig, num_threads);
    const EdgeMap& source = images.source_edges[0];
    Level level = level_for(images, factor, source.width, source.height, kEdgeDensity, rig);
    const ReducedImages& level_images = images.pyramid.at(factor);
    fill(level, images, rig, num_threads, [&](int i) {
        return std::make_unique<EdgePair>(
            level_images.edges[i],
            reduced(images.source_edges[i], level.source_width, level.source_height),
            level_images.depths[i]);
    });
    return level;
}

Level with_depths(const Level& level, const std::vector<Image>& depths,
                  const WorkingImages& images) {
    const bool whole = level.factor >= kCoarse || !images.parts.depth_edges;
    Level out = level;
    for (std::size_t i = 0; i < depths.size(); ++i)
        out.pairs[i] =
            level.pairs[i]->with_depth(whole ? depths[i] : without_depth_edges(depths[i]));
    return out;
}

Level fold_of(const Level& level, std::size_t folds, std::size_t fold, bool inside) {
    Level part = level;
    part.pairs.clear();
    part.weights.clear();
    double sum = 0;
    for (std::size_t i = 0; i < level.pairs.size(); ++i) {
        if ((i % folds == fold) != inside) continue;
        part.pairs.push_back(level.pairs[i]);
        part.weights.push_back(level.weights[i]);
        sum += level.weights[i];
    }
    for (double& weight : part.weights)
        weight = sum > 0 ? weight / sum : 1.0 / static_cast<double>(part.pairs.size());
    return part;
}

}  // namespace xcalib

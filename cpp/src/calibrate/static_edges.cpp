#include "calibrate/static_edges.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdint>
#include <vector>

namespace xcalib {
namespace {

constexpr double kStandsStill = 0.2;  // share of the edges beyond which the camera does

// A mask of the static pixels, grown by `reach` px, that covers a pixel of a level where it covers
// a part of it.
struct Mask {
    int width, height;
    std::vector<std::uint8_t> set;

    bool any(int left, int top, int right, int bottom) const {
        for (int y = std::max(0, top); y < std::min(height, bottom); ++y)
            for (int x = std::max(0, left); x < std::min(width, right); ++x)
                if (set[static_cast<std::size_t>(y) * width + x]) return true;
        return false;
    }
};

struct StillEdges {
    Mask mask;
    double share;  // of all edges
};

StillEdges still_edges(const WorkingImages& images) {
    constexpr float kCoherent = 0.97f, kStrong = 1.0f;  // of the mean
    const EdgeMap& first = images.reference_edges[0];
    const std::size_t size = first.z.size();
    std::vector<std::complex<float>> sum(size);
    std::vector<float> length(size);
    double total = 0;
    for (const EdgeMap& edges : images.reference_edges)
        for (std::size_t i = 0; i < size; ++i) {
            sum[i] += edges.z[i];
            length[i] += std::abs(edges.z[i]);
            total += std::abs(edges.z[i]);
        }
    const float mean = static_cast<float>(total / static_cast<double>(size));
    StillEdges out{{first.width, first.height, std::vector<std::uint8_t>(size)}, 0};
    double still = 0;
    for (std::size_t i = 0; i < size; ++i) {
        out.mask.set[i] = length[i] > kStrong * mean && std::abs(sum[i]) > kCoherent * length[i];
        if (out.mask.set[i]) still += length[i];
    }
    out.share = total > 0 ? still / total : 0;
    return out;
}

}  // namespace

bool camera_stands_still(const WorkingImages& images) {
    return still_edges(images).share > kStandsStill;
}

WorkingImages without_static_edges(WorkingImages images, double& share) {
    constexpr std::size_t kFrames = 6;
    constexpr int kReach = 2;  // [px], as far as gradients and blur reach
    share = 0;
    if (images.size() < kFrames) return images;
    const auto [mask, still] = still_edges(images);
    if (still == 0 || still > kStandsStill) return images;
    share = still;

    for (EdgeMap& edges : images.reference_edges)
        for (int y = 0; y < mask.height; ++y)
            for (int x = 0; x < mask.width; ++x)
                if (mask.any(x - kReach, y - kReach, x + kReach + 1, y + kReach + 1))
                    edges.z[static_cast<std::size_t>(y) * mask.width + x] = 0;
    for (auto& [factor, level] : images.pyramid)
        for (Image& depth : level.depths) {
            // From a pixel of the level to those of the mask, which may be finer or coarser.
            const auto from = [&](int at, int level_size, int mask_size) {
                return static_cast<int>(static_cast<long>(at) * mask_size / level_size);
            };
            for (int y = 0; y < depth.height; ++y)
                for (int x = 0; x < depth.width; ++x)
                    if (mask.any(from(x, depth.width, mask.width) - kReach,
                                 from(y, depth.height, mask.height) - kReach,
                                 from(x + 1, depth.width, mask.width) + kReach + 1,
                                 from(y + 1, depth.height, mask.height) + kReach + 1))
                        depth.row(y)[x] = 0;
        }
    return images;
}

}  // namespace xcalib

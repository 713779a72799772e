#include "calibrate/shared_detail.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/parallel.hpp"
#include "calibrate/judging.hpp"
#include "xcalib/gray.hpp"
#include "xcalib/warp.hpp"

namespace xcalib {
namespace {

constexpr std::size_t kFrames = 8;

// Sums of a b cos and of a b |cos| over the pixels, with a and b the lengths of the gradients.
struct Signs {
    double with_sign = 0, without = 0;
};

Signs signs_of(const Image& reference, const WarpedImage& source) {
    const auto slope = [](const Image& image, int x, int y, double& dx, double& dy) {
        dx = image.row(y)[x + 1] - image.row(y)[x - 1];
        dy = image.row(y + 1)[x] - image.row(y - 1)[x];
        return std::hypot(dx, dy);
    };
    const auto valid = [&](int x, int y) {
        for (int v = y - 1; v <= y + 1; ++v)
            for (int u = x - 1; u <= x + 1; ++u)
                if (source.validity[static_cast<std::size_t>(v) * reference.width + u] != 0)
                    return false;
        return true;
    };
    Signs sums;
    for (int y = 1; y + 1 < reference.height; ++y)
        for (int x = 1; x + 1 < reference.width; ++x) {
            if (!valid(x, y)) continue;
            double ax = 0, ay = 0, bx = 0, by = 0;
            const double length =
                slope(reference, x, y, ax, ay) * slope(source.image, x, y, bx, by);
            if (!(length > 0)) continue;
            // Strong edges do not decide alone.
            const double weight = 1 / std::sqrt(length), along = ax * bx + ay * by;
            sums.with_sign += weight * along;
            sums.without += weight * std::abs(along);
        }
    return sums;
}

}  // namespace

double same_sign(const WorkingImages& images, const Rig& rig, int num_threads) {
    const WorkingImages few = images.spread(kFrames);
    const Level sizes = make_sizes(few, kJudgedFactor, rig);
    const Rig at_level = sizes.rig_at(rig);
    const ReducedImages& level = few.pyramid.at(kJudgedFactor);
    std::vector<Signs> signs(few.size());
    parallel_each(static_cast<int>(few.size()), num_threads, [&](int i) {
        const Image source = resize_area(few.sources[i], sizes.source_width, sizes.source_height);
        signs[i] = signs_of(level.references[i], warp(at_level, source, level.depths[i]));
    });
    Signs sums;
    for (const Signs& one : signs) {
        sums.with_sign += one.with_sign;
        sums.without += one.without;
    }
    return sums.without > 0 ? sums.with_sign / sums.without : 0.0;
}

}  // namespace xcalib

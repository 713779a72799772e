#include "xcalib/depth/steady_depth.hpp"

#include <algorithm>
#include <cmath>

#include "base/median.hpp"
#include "photometry/mat.hpp"
#include "xcalib/depth/complete_depth.hpp"
#include "xcalib/flow.hpp"

namespace xcalib {
namespace {

constexpr float kMemory = 4;  // frames that a steadied value is the mean of, at most
// What starts a pixel anew, around it: depth against its prediction, relative, and the compressed
// image against its own.
constexpr float kGate = 0.04f, kMotion = 0.04f;
const cv::Size kAround(5, 5);

// Finer patches than between two modalities: edges look the same in both images. Up to 64 px.
FlowOptions flow_options() {
    FlowOptions options;
    options.step = 5;
    options.patch = 25;
    options.levels = 4;
    options.max_shift = 8;
    return options;
}

Image reciprocal(Image values) {
    for (float& value : values.pixels) value = value > 0 ? 1 / value : 0.0f;
    return values;
}

// The last frame's values where this one shows the same things.
struct Carried {
    Image inverse, image, count;
};

Carried carried(const Image& now, const Image& inverse, const Image& image, const Image& count,
                int num_threads) {
    const FlowField flow = patch_flow(now, image, nullptr, flow_options(), num_threads);
    Image x(now.width, now.height), y = x;
    if (!flow.x.empty()) {
        x = at_every_pixel(flow, flow.x, now.width, now.height);
        y = at_every_pixel(flow, flow.y, now.width, now.height);
    }
    for (int row = 0; row < now.height; ++row)
        for (int column = 0; column < now.width; ++column) {
            x.row(row)[column] += static_cast<float>(column);
            y.row(row)[column] += static_cast<float>(row);
        }
    const auto moved = [&](const Image& last, int how) {
        Image out(now.width, now.height);
        cv::Mat target = as_mat(out);
        cv::remap(as_mat(last), target, as_mat(x), as_mat(y), how, cv::BORDER_CONSTANT, 0);
        return out;
    };
    return {moved(inverse, cv::INTER_NEAREST), moved(image, cv::INTER_LINEAR),
            moved(count, cv::INTER_NEAREST)};
}

}  // namespace

Image DepthSteadier::operator()(int index, const ImageView& depth, const ImageView& reference,
                                int num_threads) {
    Image inverse = reciprocal(clean_depth(depth));
    const Image image = compressed_guide(reference, depth.width, depth.height);
    Image count(depth.width, depth.height);
    for (std::size_t i = 0; i < inverse.pixels.size(); ++i)
        count.pixels[i] = inverse.pixels[i] > 0 ? 1.0f : 0.0f;
    if (last_ == index - 1 && inverse_.width == inverse.width &&
        inverse_.height == inverse.height) {
        Carried before = carried(image, inverse_, image_, count_, num_threads);
        std::vector<float>& predicted = before.inverse.pixels;
        const auto both = [&](std::size_t i) {
            return inverse.pixels[i] > 0 && before.count.pixels[i] > 0;
        };
        // Driving by v [m] takes inverse depth u to u + v u^2: one v for the whole frame.
        std::vector<float> speeds;
        for (std::size_t i = 0; i < predicted.size(); ++i)
            if (both(i))
                speeds.push_back((inverse.pixels[i] - predicted[i]) /
                                 (predicted[i] * predicted[i]));
        if (!speeds.empty()) {
            const auto speed = static_cast<float>(median(std::move(speeds)));
            for (float& value : predicted) value += speed * value * value;
        }
        Image step(inverse.width, inverse.height);
        for (std::size_t i = 0; i < predicted.size(); ++i)
            if (both(i)) step.pixels[i] = inverse.pixels[i] - predicted[i];
        cv::Mat innovation, change, motion;
        cv::blur(as_mat(step), innovation, kAround);
        cv::absdiff(as_mat(image), as_mat(before.image), change);
        cv::blur(change, motion, kAround);
        for (int y = 0; y < inverse.height; ++y)
            for (int x = 0; x < inverse.width; ++x) {
                const auto i =
                    static_cast<std::size_t>(y) * static_cast<std::size_t>(inverse.width) +
                    static_cast<std::size_t>(x);
                const bool still = both(i) &&
                                   std::abs(innovation.at<float>(y, x)) < kGate * predicted[i] &&
                                   motion.at<float>(y, x) < kMotion;
                if (!still) continue;
                count.pixels[i] = std::min(before.count.pixels[i] + 1, kMemory);
                inverse.pixels[i] = predicted[i] + step.pixels[i] / count.pixels[i];
            }
    }
    last_ = index;
    inverse_ = inverse;
    image_ = image;
    count_ = std::move(count);
    return reciprocal(std::move(inverse));
}

}  // namespace xcalib

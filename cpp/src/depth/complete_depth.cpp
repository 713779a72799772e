#include "xcalib/depth/complete_depth.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "base/format.hpp"
#include "photometry/mat.hpp"
#include "xcalib/gray.hpp"

namespace xcalib {
namespace {

constexpr float kEdge = 0.1f;    // step of the compressed gray image that halves the conductance
constexpr int kSweeps = 4;       // relaxations per level; twice as many change the errors by less
                                 // than their scatter
constexpr double kReach = 0.02;  // distance to known depth at which confidence is down to 1/e [of
                                 // the width]
constexpr float kSpread = 0.1f;  // relative spread of inverse depth around a pixel that halves its
                                 // confidence

cv::Mat reduced(const cv::Mat& map, const cv::Size& size) {
    cv::Mat out;
    cv::resize(map, out, size, 0, 0, cv::INTER_AREA);
    return out;
}

// In (0, 1]: the bond of two neighbours.
float conductance(float a, float b) {
    const float step = (a - b) / kEdge;
    return 1 / (1 + step * step);
}

// Unknown pixels (mass 0) become the mean of their neighbours, by conductance, a few times.
cv::Mat relaxed(cv::Mat old, const cv::Mat& value, const cv::Mat& mass, const cv::Mat& guide) {
    const int width = value.cols, height = value.rows;
    cv::Mat right(value.size(), CV_32F, 0.0f), down(value.size(), CV_32F, 0.0f);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const float here = guide.at<float>(y, x);
            if (x + 1 < width) right.at<float>(y, x) = conductance(guide.at<float>(y, x + 1), here);
            if (y + 1 < height) down.at<float>(y, x) = conductance(guide.at<float>(y + 1, x), here);
        }
    value.copyTo(old, mass > 0);
    cv::Mat fresh(value.size(), CV_32F);
    for (int sweep = 0; sweep < kSweeps; ++sweep) {
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x) {
                if (mass.at<float>(y, x) > 0) {
                    fresh.at<float>(y, x) = value.at<float>(y, x);
                    continue;
                }
                float sum = 0, total = 0;
                const auto add = [&](float bond, float neighbour) {
                    sum += bond * neighbour;
                    total += bond;
                };
                if (x + 1 < width) add(right.at<float>(y, x), old.at<float>(y, x + 1));
                if (x > 0) add(right.at<float>(y, x - 1), old.at<float>(y, x - 1));
                if (y + 1 < height) add(down.at<float>(y, x), old.at<float>(y + 1, x));
                if (y > 0) add(down.at<float>(y - 1, x), old.at<float>(y - 1, x));
                fresh.at<float>(y, x) = total > 0 ? sum / total : old.at<float>(y, x);
            }
        std::swap(old, fresh);
    }
    return old;
}

// The diffusion on this level, started from the one of half the size. `mass`: > 0 where known.
cv::Mat diffused(const cv::Mat& value, const cv::Mat& mass, const cv::Mat& guide) {
    cv::Mat start;
    if (std::min(value.cols, value.rows) <= 4) {
        start = cv::Mat(value.size(), CV_32F, cv::mean(value, mass > 0));
    } else {
        const cv::Size half((value.cols + 1) / 2, (value.rows + 1) / 2);
        cv::Mat known;
        cv::Mat(mass > 0).convertTo(known, CV_32F, 1.0 / 255);
        cv::Mat share = reduced(known, half), mean = reduced(value, half);  // unknown pixels are 0
        // Area means leave some 1e-9 of a neighbour's weight: too little is none.
        for (int y = 0; y < half.height; ++y)
            for (int x = 0; x < half.width; ++x) {
                float& s = share.at<float>(y, x);
                float& m = mean.at<float>(y, x);
                m = s > 1e-3f ? m / s : 0;
                if (!(s > 1e-3f)) s = 0;
            }
        cv::resize(diffused(mean, share, reduced(guide, half)), start, value.size(), 0, 0,
                   cv::INTER_LINEAR);
    }
    return relaxed(start, value, mass, guide);
}

}  // namespace

Image compressed_guide(const ImageView& guide, int width, int height) {
    Image out(width, height);
    cv::Mat small = as_mat(out);
    const Image gray = known_gray(guide);
    cv::resize(as_mat(gray), small, small.size(), 0, 0, cv::INTER_AREA);
    for (float& value : out.pixels)
        value = std::log1p(20 * std::clamp(value, 0.0f, 1.0f)) / std::log(21.0f);
    return out;
}

CompletedDepth complete_depth(const ImageView& depth, const ImageView& guide) {
    Image inverse = clean_depth(depth);
    const Image metres = inverse;
    bool any = false;
    for (float& value : inverse.pixels) {
        any = any || value > 0;
        value = value > 0 ? 1 / value : 0;
    }
    if (!any)
        throw InputError("depth to complete is unknown everywhere, expected some pixels above 0 m");
    const long difference = std::labs(static_cast<long>(depth.width) * guide.height -
                                      static_cast<long>(depth.height) * guide.width);
    if (difference > std::max(guide.width, guide.height))
        throw InputError(format("depth is %dx%d, its guide %dx%d; expected the same aspect",
                                depth.width, depth.height, guide.width, guide.height));
    const Image small = compressed_guide(guide, depth.width, depth.height);
    const cv::Mat filled = diffused(as_mat(inverse), as_mat(metres), as_mat(small));

    CompletedDepth out{metres, Image(depth.width, depth.height, 1.0f)};
    const cv::Mat unknown = as_mat(metres) == 0;
    cv::Mat distance, mean, square;
    cv::distanceTransform(unknown, distance, cv::DIST_L2, 5);
    const int side = 2 * static_cast<int>(std::nearbyint(0.012 * depth.width)) + 1;
    cv::blur(filled, mean, {side, side});
    cv::blur(filled.mul(filled), square, {side, side});
    for (int y = 0; y < depth.height; ++y)
        for (int x = 0; x < depth.width; ++x) {
            if (!unknown.at<std::uint8_t>(y, x)) continue;
            out.depth.row(y)[x] = 1 / filled.at<float>(y, x);
            const float m = mean.at<float>(y, x);
            // Squared and relative.
            const float spread = std::max(square.at<float>(y, x) - m * m, 0.0f) / (m * m);
            out.confidence.row(y)[x] =
                static_cast<float>(std::exp(-distance.at<float>(y, x) / (kReach * depth.width)) /
                                   (1 + spread / (kSpread * kSpread)));
        }
    return out;
}

Image completed(const ImageView& depth, const ImageView& guide, double min_confidence) {
    if (!(min_confidence >= 0 && min_confidence <= 1))
        throw InputError(
            format("completion confidence is %g, expected between 0 and 1", min_confidence));
    CompletedDepth dense = complete_depth(depth, guide);
    for (std::size_t i = 0; i < dense.depth.pixels.size(); ++i)
        if (dense.confidence.pixels[i] < static_cast<float>(min_confidence))
            dense.depth.pixels[i] = 0;
    return std::move(dense.depth);
}

}  // namespace xcalib

#include "xcalib/flow.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>

#include "base/parallel.hpp"
#include "objective/correlate_patches.hpp"
#include "photometry/mat.hpp"

namespace xcalib {
namespace {

constexpr double kBlur = 0.8;                // before edges are found [px]
constexpr int kRim = 3;                      // [px] of that blur and the gradient's stencil
constexpr double kContrast = 24.0;           // [px] magnitudes are measured by their mean over this
constexpr float kFloor = 0.5f, kCap = 2.0f;  // in such means
constexpr double kSmooth = 1.0;              // of edge maps, before they are compared [px]
constexpr double kSurroundings = 4.0;        // [px] whose mean is taken off
constexpr int kFine = 2;                     // [px] searched at every level but the coarsest
constexpr int kSmallest = 2;                 // [patches] shorter side of a level but the finest

constexpr int kChannels = 2;  // a cos 2t, a sin 2t

// Edges with the doubled angle, as in edge_map.hpp, by local contrast; 0 where not valid. And how
// far a pixel counts.
struct Edges {
    std::array<cv::Mat, kChannels> z;
    cv::Mat weight;  // [0, 1]

    cv::Size size() const { return weight.size(); }
};

// The mean over a (large) square around each pixel; a box will do.
cv::Mat surrounding_mean(const cv::Mat& map, double sigma) {
    const int side = 2 * static_cast<int>(std::lround(1.7 * sigma)) + 1;
    cv::Mat out;
    cv::blur(map, out, cv::Size(side, side), cv::Point(-1, -1), cv::BORDER_REFLECT_101);
    return out;
}

Edges edges_of(const Image& image, const std::uint8_t* valid) {
    Edges edges;
    const cv::Size size(image.width, image.height);
    cv::Mat counts(size, CV_8U, cv::Scalar(1));
    if (valid) {
        for (std::size_t i = 0; i < image.pixels.size(); ++i) counts.data[i] = valid[i] ? 1 : 0;
        // The rim of a warp is not an edge.
        cv::erode(counts, counts, cv::Mat(), cv::Point(-1, -1), kRim, cv::BORDER_REPLICATE);
    }
    counts.convertTo(edges.weight, CV_32F);
    const cv::Mat smooth = blurred(as_mat(image), kBlur);
    cv::Mat gx, gy, magnitude;
    const cv::Mat central = (cv::Mat_<float>(1, 3) << -0.5f, 0, 0.5f);
    cv::filter2D(smooth, gx, CV_32F, central, cv::Point(-1, -1), 0, cv::BORDER_REPLICATE);
    cv::filter2D(smooth, gy, CV_32F, central.t(), cv::Point(-1, -1), 0, cv::BORDER_REPLICATE);
    cv::magnitude(gx, gy, magnitude);
    cv::multiply(magnitude, edges.weight, magnitude);
    // By local contrast: an edge in the dark, or a faint one of the other spectrum, counts like one
    // in the light. A part of the global mean keeps bare noise down.
    const float mean =
        static_cast<float>(cv::sum(magnitude)[0] / std::max(1.0, cv::sum(edges.weight)[0]));
    const cv::Mat local = surrounding_mean(magnitude, kContrast);
    for (cv::Mat& z : edges.z) z = cv::Mat::zeros(size, CV_32F);
    for (int y = 0; y < size.height; ++y) {
        const float* x_row = gx.ptr<float>(y);
        const float* y_row = gy.ptr<float>(y);
        const float* g_row = magnitude.ptr<float>(y);
        const float* m_row = local.ptr<float>(y);
        for (int x = 0; x < size.width; ++x) {
            const float g = g_row[x];
            if (!(g > 0)) continue;
            const float a = std::min(g / (0.8f * m_row[x] + 0.2f * mean), kCap) - kFloor;
            if (!(a > 0)) continue;
            const float c = x_row[x] / g, s = y_row[x] / g;
            const float c2 = c * c - s * s, s2 = 2 * c * s;
            edges.z[0].at<float>(y, x) = a * c2;
            edges.z[1].at<float>(y, x) = a * s2;
        }
    }
    return edges;
}

Edges halved(const Edges& edges) {
    Edges out;
    const cv::Size size(edges.size().width / 2, edges.size().height / 2);
    for (int k = 0; k < kChannels; ++k)
        cv::resize(edges.z[k], out.z[k], size, 0, 0, cv::INTER_AREA);
    cv::resize(edges.weight, out.weight, size, 0, 0, cv::INTER_AREA);
    return out;
}

// As they are compared: what all edges of a region have in common does not show where it lies.
Edges comparable(const Edges& edges) {
    Edges out;
    out.weight = edges.weight;
    for (int k = 0; k < kChannels; ++k) {
        const cv::Mat smooth = blurred(edges.z[k], kSmooth);
        out.z[k] = smooth - surrounding_mean(smooth, kSurroundings);
        cv::multiply(out.z[k], edges.weight, out.z[k]);
    }
    return out;
}

// Edges of the other image where the flow says they are; nothing beyond its border.
Edges warped_by(const Edges& edges, const cv::Mat& flow_x, const cv::Mat& flow_y) {
    cv::Mat at_x = flow_x.clone(), at_y = flow_y.clone();
    for (int y = 0; y < at_x.rows; ++y) {
        float* u = at_x.ptr<float>(y);
        float* v = at_y.ptr<float>(y);
        for (int x = 0; x < at_x.cols; ++x) {
            u[x] += static_cast<float>(x);
            v[x] += static_cast<float>(y);
        }
    }
    cv::Mat fast, table;
    cv::convertMaps(at_x, at_y, fast, table, CV_16SC2);
    Edges out;
    const auto move = [&](const cv::Mat& from, cv::Mat& to) {
        cv::remap(from, to, fast, table, cv::INTER_LINEAR, cv::BORDER_CONSTANT, cv::Scalar(0));
    };
    for (int k = 0; k < kChannels; ++k) move(edges.z[k], out.z[k]);
    move(edges.weight, out.weight);
    return out;
}

// One value for each shift of each cell.
struct Volume {
    int radius = 0, pitch = 0;
    cv::Size grid;
    std::vector<float> score;  // by dy, row, column and dx; in [-1, 1], or kNoCorrelation

    float* row(int dy) {
        return &score[static_cast<std::size_t>(dy + radius) * grid.area() * pitch];
    }
    float at(int cell, int dx, int dy) const {
        const std::size_t row = static_cast<std::size_t>(dy + radius) * grid.area() + cell;
        return score[row * pitch + dx + radius];
    }
};

// What a correlation reads of an image's edges, with a margin of nothing around.
struct EdgePlanes {
    std::array<cv::Mat, kChannels> z;
    cv::Mat square, weight;

    EdgePlanes(const Edges& edges, int margin, int right) {
        const auto padded = [&](const cv::Mat& map, cv::Mat& out) {
            cv::copyMakeBorder(map, out, margin, margin, margin, right, cv::BORDER_CONSTANT,
                               cv::Scalar(0));
        };
        for (int k = 0; k < kChannels; ++k) padded(edges.z[k], z[k]);
        padded(edges.weight, weight);
        square = z[0].mul(z[0]) + z[1].mul(z[1]);
    }

    EdgeRows from(int y) const {
        return {z[0].ptr<float>(y), z[1].ptr<float>(y), square.ptr<float>(y), weight.ptr<float>(y),
                weight.step1()};
    }
};

// Weights of the cells of a patch along one side: most in the middle, so that a vector speaks for
// where it stands.
std::vector<float> patch_profile(int cells) {
    std::vector<double> profile(cells);
    for (int i = 0; i < cells; ++i)
        profile[i] = std::pow(std::sin(CV_PI * (i + 1) / (cells + 1)), 2);
    const double sum = std::accumulate(profile.begin(), profile.end(), 0.0);
    std::vector<float> out;
    for (const double weight : profile) out.push_back(static_cast<float>(weight / sum));
    return out;
}

// Correlates all patches of a with b at all shifts.
Volume correlate(const Edges& a, const Edges& b, int radius, const FlowOptions& options,
                 int num_threads) {
    const int side = 2 * radius + 1;
    const int pitch = rounded_up(side);
    const std::vector<float> profile = patch_profile(options.patch / options.step);
    const PatchGrid grid{a.size().width / options.step, a.size().height / options.step,
                         options.step, profile.data(), static_cast<int>(profile.size())};
    const EdgePlanes still(a, 0, 0), moved(b, radius, radius + pitch - side);
    Volume volume{radius, pitch, cv::Size(grid.width, grid.height), {}};
    volume.score.resize(static_cast<std::size_t>(side) * volume.grid.area() * pitch);
    parallel_each(side, num_threads, [&](int index) {
        correlate_patches(still.from(0), moved.from(index), grid, side, volume.row(index - radius));
    });
    return volume;
}

// The best shift of a patch and what speaks for it.
struct Peak {
    float x = 0, y = 0;   // [px] of the level
    float height = 0;     // correlation
    float margin = 0;     // above everything farther away
    float curvature = 0;  // in the flattest direction [1/px^2]
};

Peak best_shift(const Volume& volume, int cell) {
    const int r = volume.radius;
    const auto score = [&](int dx, int dy) { return volume.at(cell, dx, dy); };
    int bx = 0, by = 0;
    float best = kNoCorrelation;
    for (int dy = -r; dy <= r; ++dy)
        for (int dx = -r; dx <= r; ++dx)
            if (score(dx, dy) > best) {
                best = score(dx, dy);
                bx = dx;
                by = dy;
            }
    Peak peak;
    if (!(best > 0)) return peak;
    peak.x = static_cast<float>(bx);
    peak.y = static_cast<float>(by);
    peak.height = best;
    if (std::max(std::abs(bx), std::abs(by)) == r) return peak;  // no peak, an edge of the search
    constexpr int kOwn = 2;  // [px] around a peak that are its own
    float elsewhere = 0;
    for (int dy = -r; dy <= r; ++dy)
        for (int dx = -r; dx <= r; ++dx)
            if (std::max(std::abs(dx - bx), std::abs(dy - by)) > kOwn)
                elsewhere = std::max(elsewhere, score(dx, dy));
    peak.margin = best - elsewhere;
    // A neighbour without enough valid pixels has no value to put a paraboloid through.
    for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx)
            if (score(bx + dx, by + dy) == kNoCorrelation) return peak;
    // The paraboloid through the nine values around the peak.
    const auto at = [&](int dx, int dy) { return score(bx + dx, by + dy); };
    const float gx = 0.5f * (at(1, 0) - at(-1, 0)), gy = 0.5f * (at(0, 1) - at(0, -1));
    const float xx = at(1, 0) - 2 * best + at(-1, 0), yy = at(0, 1) - 2 * best + at(0, -1);
    const float xy = 0.25f * (at(1, 1) + at(-1, -1) - at(1, -1) - at(-1, 1));
    const float determinant = xx * yy - xy * xy;
    if (!(determinant > 0 && xx < 0)) return peak;
    const float half = 0.5f * (xx + yy);
    peak.curvature = -(half + std::sqrt(std::max(0.0f, half * half - determinant)));
    peak.x += std::clamp(-(yy * gx - xy * gy) / determinant, -0.7f, 0.7f);
    peak.y += std::clamp(-(xx * gy - xy * gx) / determinant, -0.7f, 0.7f);
    return peak;
}

float ramp(float value, float low, float high) {
    return std::clamp((value - low) / (high - low), 0.0f, 1.0f);
}

cv::Mat grid_mat(const FlowField& field, const std::vector<float>& values) {
    return {field.height, field.width, CV_32F, const_cast<float*>(values.data())};
}

// Grid points that have no sure shift take what their neighbours say.
cv::Mat smoothed(const cv::Mat& values, const cv::Mat& weight) {
    cv::Mat above = values.mul(weight), below;
    cv::GaussianBlur(above, above, cv::Size(), 1.5, 1.5, cv::BORDER_CONSTANT);
    cv::GaussianBlur(weight, below, cv::Size(), 1.5, 1.5, cv::BORDER_CONSTANT);
    cv::Mat out;
    cv::divide(above, below, out);
    return out;
}

cv::Mat dense(const FlowField& field, const std::vector<float>& values, cv::Size size) {
    // cv::resize puts the values at the middles of the cells, which is where they stand.
    const cv::Size whole(field.width * field.step, field.height * field.step);
    cv::Mat out;
    cv::resize(grid_mat(field, values), out, whole, 0, 0, cv::INTER_LINEAR);
    cv::copyMakeBorder(out, out, 0, size.height - whole.height, 0, size.width - whole.width,
                       cv::BORDER_REPLICATE);
    return out;
}

using Pyramid = std::vector<Edges>;  // finest first

Pyramid pyramid_of(const Image& image, const std::uint8_t* valid, int levels) {
    Pyramid raw{edges_of(image, valid)};
    for (int level = 1; level < levels; ++level) raw.push_back(halved(raw.back()));
    Pyramid out;
    for (const Edges& edges : raw) out.push_back(comparable(edges));
    return out;
}

// Flow from a to b, coarse to fine. Its confidence leaves out the other direction.
FlowField one_way(const Pyramid& a, const Pyramid& b, const FlowOptions& options, int num_threads) {
    const int levels = static_cast<int>(a.size());
    cv::Mat flow_x, flow_y, sure;  // dense, of the level before
    FlowField field;
    for (int level = levels - 1; level >= 0; --level) {
        const cv::Size size = a[level].size();
        const bool coarsest = level == levels - 1;
        if (coarsest) {
            flow_x = cv::Mat::zeros(size, CV_32F);
            flow_y = cv::Mat::zeros(size, CV_32F);
            sure = cv::Mat::ones(size, CV_32F);
        } else {
            const double sx = static_cast<double>(size.width) / flow_x.cols;
            const double sy = static_cast<double>(size.height) / flow_x.rows;
            cv::resize(flow_x * sx, flow_x, size, 0, 0, cv::INTER_LINEAR);
            cv::resize(flow_y * sy, flow_y, size, 0, 0, cv::INTER_LINEAR);
            cv::resize(sure, sure, size, 0, 0, cv::INTER_LINEAR);
        }
        const int radius = coarsest ? (options.max_shift >> level) + 1 : kFine;
        const Edges moved = coarsest ? b[level] : warped_by(b[level], flow_x, flow_y);
        const Volume volume = correlate(a[level], moved, radius, options, num_threads);
        field.step = options.step;
        field.width = size.width / options.step;
        field.height = size.height / options.step;
        const std::size_t count = static_cast<std::size_t>(field.width) * field.height;
        field.x.assign(count, 0.0f);
        field.y.assign(count, 0.0f);
        field.confidence.assign(count, 0.0f);
        for (int row = 0; row < field.height; ++row)
            for (int column = 0; column < field.width; ++column) {
                const std::size_t i = static_cast<std::size_t>(row) * field.width + column;
                const int x = column * options.step + options.step / 2;
                const int y = row * options.step + options.step / 2;
                const Peak peak = best_shift(volume, static_cast<int>(i));
                field.x[i] = flow_x.at<float>(y, x) + peak.x;
                field.y[i] = flow_y.at<float>(y, x) + peak.y;
                // Height, texture in both directions, distinctness; and all that at coarser levels.
                float certainty = ramp(peak.height, 0.1f, 0.4f) * ramp(peak.curvature, 0.0f, 0.03f);
                if (radius > kFine) certainty *= ramp(peak.margin, 0.0f, 0.1f);
                field.confidence[i] = std::sqrt(certainty * sure.at<float>(y, x));
            }
        if (level == 0) break;
        const cv::Mat weight = grid_mat(field, field.confidence) + 1e-3;
        FlowField smooth = field;
        smoothed(grid_mat(field, field.x), weight).copyTo(grid_mat(smooth, smooth.x));
        smoothed(grid_mat(field, field.y), weight).copyTo(grid_mat(smooth, smooth.y));
        flow_x = dense(smooth, smooth.x, size);
        flow_y = dense(smooth, smooth.y, size);
        smoothed(grid_mat(field, field.confidence), cv::Mat::ones(weight.size(), CV_32F))
            .copyTo(grid_mat(smooth, smooth.confidence));
        sure = dense(smooth, smooth.confidence, size);
    }
    return field;
}

}  // namespace

void FlowOptions::validate() const {
    const auto refuse = [](const char* field, int value, const std::string& expected) {
        throw std::invalid_argument(std::string("flow ") + field + " is " + std::to_string(value) +
                                    ", expected " + expected);
    };
    if (step < 3 || step % 2 == 0) refuse("step", step, "an odd number >= 3 [px]");
    if (patch < step || patch % step != 0 || patch / step % 2 == 0)
        refuse("patch", patch, "an odd multiple of the step, " + std::to_string(step) + " [px]");
    if (levels < 1) refuse("levels", levels, ">= 1");
    if (max_shift < 1) refuse("max_shift", max_shift, ">= 1 [px]");
}

FlowField patch_flow(const Image& reference, const Image& warped, const std::uint8_t* valid,
                     const FlowOptions& options, int num_threads) {
    options.validate();
    if (reference.width != warped.width || reference.height != warped.height)
        throw std::invalid_argument("warped image is " + std::to_string(warped.width) + "x" +
                                    std::to_string(warped.height) + ", expected the reference's " +
                                    std::to_string(reference.width) + "x" +
                                    std::to_string(reference.height));
    const int shorter = std::min(reference.width, reference.height);
    if (shorter < options.step) return {0, 0, options.step, {}, {}, {}};
    int levels = 1;
    while (levels < options.levels && shorter >> levels >= kSmallest * options.patch) ++levels;
    const Pyramid a = pyramid_of(reference, nullptr, levels);
    const Pyramid b = pyramid_of(warped, valid, levels);
    FlowField there = one_way(a, b, options, num_threads);
    const FlowField back = one_way(b, a, options, num_threads);
    const cv::Mat back_x = dense(back, back.x, a[0].size());
    const cv::Mat back_y = dense(back, back.y, a[0].size());
    const cv::Mat back_sure = dense(back, back.confidence, a[0].size());
    for (int row = 0; row < there.height; ++row)
        for (int column = 0; column < there.width; ++column) {
            const std::size_t i = static_cast<std::size_t>(row) * there.width + column;
            float& confidence = there.confidence[i];
            const int x = static_cast<int>(
                std::lround(column * options.step + options.step / 2 + there.x[i]));
            const int y =
                static_cast<int>(std::lround(row * options.step + options.step / 2 + there.y[i]));
            if (x < 0 || y < 0 || x >= reference.width || y >= reference.height) {
                confidence = 0;
                continue;
            }
            const float missed = std::hypot(there.x[i] + back_x.at<float>(y, x),
                                            there.y[i] + back_y.at<float>(y, x));
            constexpr float kMissed = 2.0f;  // [px] both ways together
            confidence = std::sqrt(confidence * back_sure.at<float>(y, x)) *
                         (1 - ramp(missed, 0.0f, kMissed));
        }
    return there;
}

Image at_every_pixel(const FlowField& field, const std::vector<float>& values, int width,
                     int height) {
    Image out(width, height);
    if (values.empty()) return out;
    dense(field, values, cv::Size(width, height)).copyTo(as_mat(out));
    return out;
}

}  // namespace xcalib

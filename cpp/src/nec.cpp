#include "xcalib/nec.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>

#include "bilinear.hpp"

namespace xcalib {
namespace {

constexpr float kUpperClamp = 5.0f;

// Floats in, double sums.
inline double squared(double x, double y) { return x * x + y * y; }

// The objective's gradient vector after the soft floor, and d(clamped)/d(gradient):
//     along n: `along`, across n: `across`.
struct Clamped {
    float x, y;
    float along, across;
};

inline Clamped clamp_gradient(float gx, float gy, float g, float mean) {
    const bool saturated = g >= kUpperClamp * mean;
    const float across = (saturated ? (kUpperClamp - 1) * mean : g - mean) / g;
    return {gx * across, gy * across, saturated ? 0.0f : 1.0f, across};
}

// A warped row with what its stencil needs. Derivatives are dI'/dp, parameter-major.
struct WarpedRow {
    std::vector<float> u, v, value, du, dv, derivative;
    std::vector<std::uint8_t> validity;

    WarpedRow(int width, int count)
        : u(width), v(width), value(width), du(width), dv(width),
          derivative(static_cast<std::size_t>(width) * count), validity(width) {}
};

template <int kCount>
void warp_row(const NecFrame& frame, const Rig& rig, const Reprojection& reprojection,
              const ProjectionDerivative& derivative, int y, WarpedRow& row) {
    const int width = frame.depth.width;
    const float* depth = frame.depth.row(y);
    map_row(reprojection, depth, y, width, row.u.data(), row.v.data(), row.validity.data());
    for (int x = 0; x < width; ++x) {
        if (row.validity[x] != 0) {
            row.value[x] = row.du[x] = row.dv[x] = 0;
            continue;
        }
        const Sample sample = bilinear(frame.source, row.u[x], row.v[x]);
        row.value[x] = sample.value;
        row.du[x] = sample.du;
        row.dv[x] = sample.dv;
    }
    if constexpr (kCount > 0) {
        // Apart from the sampling, so that it vectorizes. Where a pixel is not valid the result
        // may be anything: no stencil reads it.
        const double ray_y = (y - rig.reference.cy) / rig.reference.fy;
        const double ray_x0 = -(rig.reference.cx + rig.reference.skew * ray_y) / rig.reference.fx;
        const float start = static_cast<float>(ray_x0);
        const float step = static_cast<float>(1 / rig.reference.fx);
        const float* __restrict du = row.du.data();
        const float* __restrict dv = row.dv.data();
        float* __restrict out = row.derivative.data();
        const ProjectionDerivative d = derivative;
        for (int x = 0; x < width; ++x)
            d.chain<kCount>(start + step * static_cast<float>(x), static_cast<float>(ray_y),
                            depth[x], du[x], dv[x], out + x, width);
    }
}

// One pixel whose whole stencil is valid and whose source gradient stands above the floor.
template <int kCount>
struct EdgePixel {
    float reference_x, reference_y;             // a n_R, times the polarity s
    float source_x, source_y;                   // v = b n_S
    float jacobian_x[kCount > 0 ? kCount : 1];  // dv/dp
    float jacobian_y[kCount > 0 ? kCount : 1];

    float magnitudes() const {  // a b
        return std::sqrt((reference_x * reference_x + reference_y * reference_y) *
                         (source_x * source_x + source_y * source_y));
    }
};

// The one pass over the rows that everything here is made of: calls sink.valid(a n_R) for each
// pixel with a valid stencil and sink.edge(EdgePixel) where the source has an edge too.
template <int kCount, class Sink>
void for_each_pixel(const NecFrame& frame, const Rig& rig, Sink& sink) {
    const int width = frame.depth.width, height = frame.depth.height;
    const Reprojection reprojection(rig);
    const ProjectionDerivative derivative(rig);
    std::array<std::unique_ptr<WarpedRow>, 3> rows;
    for (auto& row : rows) row = std::make_unique<WarpedRow>(width, kCount);
    const auto fill = [&](int y) {
        warp_row<kCount>(frame, rig, reprojection, derivative, y, *rows[y % 3]);
    };
    if (height < 3) return;
    fill(0);
    fill(1);
    EdgePixel<kCount> pixel;
    for (int y = 1; y + 1 < height; ++y) {
        fill(y + 1);
        const WarpedRow& above = *rows[(y - 1) % 3];
        const WarpedRow& here = *rows[y % 3];
        const WarpedRow& below = *rows[(y + 1) % 3];
        const std::size_t offset = static_cast<std::size_t>(y) * width;
        for (int x = 1; x + 1 < width; ++x) {
            if (above.validity[x] | here.validity[x - 1] | here.validity[x] | here.validity[x + 1] |
                below.validity[x])
                continue;
            const float ax = frame.reference.x[offset + x], ay = frame.reference.y[offset + x];
            sink.valid(ax, ay);
            const float gx = 0.5f * (here.value[x + 1] - here.value[x - 1]);
            const float gy = 0.5f * (below.value[x] - above.value[x]);
            const float g = std::sqrt(gx * gx + gy * gy);
            if (!(g > frame.source_mean)) continue;
            const Clamped v = clamp_gradient(gx, gy, g, frame.source_mean);
            const float polarity = ax * v.x + ay * v.y < 0 ? -1.0f : 1.0f;
            pixel.reference_x = polarity * ax;
            pixel.reference_y = polarity * ay;
            pixel.source_x = v.x;
            pixel.source_y = v.y;
            if constexpr (kCount > 0) {
                const float nx = gx / g, ny = gy / g;
                const float turn = v.along - v.across;
                for (int p = 0; p < kCount; ++p) {
                    const std::size_t column = static_cast<std::size_t>(p) * width + x;
                    const float dx =
                        0.5f * (here.derivative[column + 1] - here.derivative[column - 1]);
                    const float dy = 0.5f * (below.derivative[column] - above.derivative[column]);
                    const float radial = turn * (nx * dx + ny * dy);
                    pixel.jacobian_x[p] = radial * nx + v.across * dx;
                    pixel.jacobian_y[p] = radial * ny + v.across * dy;
                }
            }
            sink.edge(pixel);
        }
        sink.end_row();
    }
}

// Sums of the NEC alone.
struct ValueSink {
    double aa = 0, vv = 0, av = 0, magnitudes = 0;

    void valid(float ax, float ay) { aa += squared(ax, ay); }
    void edge(const EdgePixel<0>& p) {
        vv += squared(p.source_x, p.source_y);
        av += double(p.reference_x) * p.source_x + double(p.reference_y) * p.source_y;
        magnitudes += p.magnitudes();
    }
    void end_row() {}
};

// The Gram matrix of the columns [dv/dp ..., v, s a n_R] over a row's edge pixels: every sum that
// the normal equations need.
template <int kCount>
struct GramSink {
    static constexpr int kSize = kCount + 2;
    using Tile = Eigen::Matrix<double, kSize, Eigen::Dynamic>;

    double aa = 0, magnitudes = 0;
    Eigen::Matrix<double, kSize, kSize> gram = Eigen::Matrix<double, kSize, kSize>::Zero();
    Tile tile;
    int filled = 0;

    explicit GramSink(int width) : tile(kSize, 2 * width) {}
    void valid(float ax, float ay) { aa += squared(ax, ay); }
    void edge(const EdgePixel<kCount>& p) {
        for (int i = 0; i < kCount; ++i) {
            tile(i, filled) = p.jacobian_x[i];
            tile(i, filled + 1) = p.jacobian_y[i];
        }
        tile(kCount, filled) = p.source_x;
        tile(kCount, filled + 1) = p.source_y;
        tile(kCount + 1, filled) = p.reference_x;
        tile(kCount + 1, filled + 1) = p.reference_y;
        filled += 2;
        magnitudes += p.magnitudes();
    }
    void end_row() {
        const auto part = tile.leftCols(filled);
        gram.template selfadjointView<Eigen::Lower>().rankUpdate(part);
        filled = 0;
    }
};

template <int kCount>
struct RowsSink {
    double aa = 0, vv = 0;
    struct Row {
        float a, v;  // one component of s a n_R and of v
        std::array<float, kCount> dv;
    };
    std::vector<Row> rows;
    std::vector<float> unmatched;  // components of a n_R where the source has no edge

    void valid(float ax, float ay) {
        aa += squared(ax, ay);
        unmatched.push_back(ax);
        unmatched.push_back(ay);
    }
    void edge(const EdgePixel<kCount>& p) {
        unmatched.resize(unmatched.size() - 2);  // it was pushed by valid() just before
        vv += squared(p.source_x, p.source_y);
        Row x{p.reference_x, p.source_x, {}}, y{p.reference_y, p.source_y, {}};
        std::copy_n(p.jacobian_x, kCount, x.dv.begin());
        std::copy_n(p.jacobian_y, kCount, y.dv.begin());
        rows.push_back(x);
        rows.push_back(y);
    }
    void end_row() {}
};

NecValue value_from_sums(const NecFrame& frame, double aa, double vv, double av,
                         double magnitudes) {
    constexpr double kMeanCosine = 2 / 3.14159265358979323846;  // of unrelated directions
    NecValue value;
    value.norm = std::sqrt(aa * vv);
    value.nec = value.norm > 0 ? av / value.norm : 0.0;
    value.aligned =
        value.norm > 0 ? (av - kMeanCosine * magnitudes) / ((1 - kMeanCosine) * value.norm) : 0.0;
    value.valid_share = frame.reference_energy > 0 ? aa / frame.reference_energy : 0.0;
    return value;
}

template <int kCount>
NecNormalEquations normal_equations(const NecFrame& frame, const Rig& rig) {
    GramSink<kCount> sink(frame.depth.width);
    for_each_pixel<kCount>(frame, rig, sink);
    const Eigen::MatrixXd gram = sink.gram.template selfadjointView<Eigen::Lower>();
    const double vv = gram(kCount, kCount), av = gram(kCount + 1, kCount);
    NecNormalEquations out;
    out.value = value_from_sums(frame, sink.aa, vv, av, sink.magnitudes);
    out.hessian = Eigen::MatrixXd::Zero(kCount, kCount);
    out.gradient = Eigen::VectorXd::Zero(kCount);
    if (out.value.norm <= 0) return out;
    // V = v / ||v||, dV = (dv - V (V . dv)) / ||v||: a rank-one correction of the plain sums.
    const Eigen::VectorXd v_dv = gram.block(kCount, 0, 1, kCount).transpose();
    const Eigen::VectorXd a_dv = gram.block(kCount + 1, 0, 1, kCount).transpose();
    out.hessian = (gram.topLeftCorner(kCount, kCount) - v_dv * v_dv.transpose() / vv) / vv;
    out.gradient = -(a_dv - v_dv * (av / vv)) / out.value.norm;
    return out;
}

template <int kCount>
NecRows rows_of(const NecFrame& frame, const Rig& rig) {
    RowsSink<kCount> sink;
    for_each_pixel<kCount>(frame, rig, sink);
    const Eigen::Index edges = static_cast<Eigen::Index>(sink.rows.size());
    const Eigen::Index rest = static_cast<Eigen::Index>(sink.unmatched.size());
    NecRows out;
    out.residuals = Eigen::VectorXd::Zero(edges + rest);
    out.jacobian = Eigen::MatrixXd::Zero(edges + rest, kCount);
    const double norm_a = std::sqrt(sink.aa), norm_v = std::sqrt(sink.vv);
    Eigen::VectorXd unit(edges);
    Eigen::MatrixXd dv(edges, kCount);
    for (Eigen::Index i = 0; i < edges; ++i) {
        unit[i] = sink.rows[i].v / norm_v;
        for (int p = 0; p < kCount; ++p) dv(i, p) = sink.rows[i].dv[p];
        out.residuals[i] = sink.rows[i].a / norm_a - unit[i];  // s r: the sign has no say in J^T J
    }
    out.jacobian.topRows(edges) = -(dv - unit * (unit.transpose() * dv)) / norm_v;
    for (Eigen::Index i = 0; i < rest; ++i) out.residuals[edges + i] = sink.unmatched[i] / norm_a;
    return out;
}

}  // namespace

double nec(const Image& reference, const Image& registered, const std::uint8_t* valid,
           NecFloor floor) {
    const int width = reference.width, height = reference.height;
    struct Gradient {
        float x, y, g;
    };
    std::vector<Gradient> a, b;
    const auto forward = [](const Image& image, int x, int y) {
        const float* row = image.row(y) + x;
        const float gx = row[1] - row[0], gy = row[image.width] - row[0];
        return Gradient{gx, gy, std::sqrt(gx * gx + gy * gy)};
    };
    for (int y = 0; y + 1 < height; ++y)
        for (int x = 0; x + 1 < width; ++x) {
            const std::size_t i = static_cast<std::size_t>(y) * width + x;
            if (valid && !(valid[i] && valid[i + 1] && valid[i + width])) continue;
            a.push_back(forward(reference, x, y));
            b.push_back(forward(registered, x, y));
        }
    // Eq. (gradient_clamping); r is the share of pixels whose gradient is not zero.
    const auto limits = [floor](const std::vector<Gradient>& field) {
        double sum = 0;
        std::size_t active = 0;
        for (const Gradient& v : field) {
            sum += v.g;
            active += v.g > 0;
        }
        const double mean = sum / static_cast<double>(field.size());
        const double share = static_cast<double>(active) / static_cast<double>(field.size());
        return std::pair<double, double>(
            floor == NecFloor::printed && active > 0 ? 2 * mean / share : 0.0, 5 * mean);
    };
    if (a.empty()) return std::numeric_limits<double>::quiet_NaN();
    const auto [low_a, high_a] = limits(a);
    const auto [low_b, high_b] = limits(b);
    double ab = 0, aa = 0, bb = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
        const double ga = std::max(std::min<double>(a[i].g, high_a), low_a);
        const double gb = std::max(std::min<double>(b[i].g, high_b), low_b);
        // atan2(0, 0) is 0: a pixel without gradient points along x.
        const double nax = a[i].g > 0 ? a[i].x / a[i].g : 1.0,
                     nay = a[i].g > 0 ? a[i].y / a[i].g : 0.0;
        const double nbx = b[i].g > 0 ? b[i].x / b[i].g : 1.0,
                     nby = b[i].g > 0 ? b[i].y / b[i].g : 0.0;
        ab += ga * gb * std::abs(nax * nbx + nay * nby);
        aa += ga * ga;
        bb += gb * gb;
    }
    return aa > 0 && bb > 0 ? ab / std::sqrt(aa * bb) : std::numeric_limits<double>::quiet_NaN();
}

EdgeField edge_field(const Image& image, float mean_magnitude) {
    EdgeField field{image.width, image.height, {}, {}};
    field.x.assign(image.pixels.size(), 0.0f);
    field.y.assign(image.pixels.size(), 0.0f);
    for (int y = 1; y + 1 < image.height; ++y)
        for (int x = 1; x + 1 < image.width; ++x) {
            const float* p = image.row(y) + x;
            const float gx = 0.5f * (p[1] - p[-1]);
            const float gy = 0.5f * (p[image.width] - p[-image.width]);
            const float g = std::sqrt(gx * gx + gy * gy);
            if (!(g > mean_magnitude)) continue;
            const Clamped v = clamp_gradient(gx, gy, g, mean_magnitude);
            const std::size_t i = static_cast<std::size_t>(y) * image.width + x;
            field.x[i] = v.x;
            field.y[i] = v.y;
        }
    return field;
}

float mean_gradient(const Image& image, const std::uint8_t* validity) {
    double sum = 0;
    std::size_t count = 0;
    for (int y = 1; y + 1 < image.height; ++y)
        for (int x = 1; x + 1 < image.width; ++x) {
            const std::size_t i = static_cast<std::size_t>(y) * image.width + x;
            if (validity && (validity[i - image.width] | validity[i - 1] | validity[i] |
                             validity[i + 1] | validity[i + image.width]))
                continue;
            const float* p = image.pixels.data() + i;
            const float gx = p[1] - p[-1], gy = p[image.width] - p[-image.width];
            sum += 0.5f * std::sqrt(gx * gx + gy * gy);
            ++count;
        }
    return count > 0 ? static_cast<float>(sum / static_cast<double>(count)) : 0.0f;
}

NecFrame make_nec_frame(const Image& reference, const Image& source, const Image& depth,
                        const Rig& rig) {
    NecFrame frame;
    frame.reference = edge_field(reference, mean_gradient(reference, nullptr));
    frame.depth = depth;
    frame.source = source;
    const WarpedImage warped = warp(rig, source, depth);
    frame.source_mean = mean_gradient(warped.image, warped.validity.data());
    for (std::size_t i = 0; i < depth.pixels.size(); ++i) {
        float& x = frame.reference.x[i];
        float& y = frame.reference.y[i];
        if (depth.pixels[i] <= 0) x = y = 0.0f;
        frame.reference_energy += squared(x, y);
    }
    return frame;
}

NecValue evaluate_nec(const NecFrame& frame, const Rig& rig) {
    ValueSink sink;
    for_each_pixel<0>(frame, rig, sink);
    return value_from_sums(frame, sink.aa, sink.vv, sink.av, sink.magnitudes);
}

NecNormalEquations nec_normal_equations(const NecFrame& frame, const Rig& rig, int count) {
    return count <= kNumWithoutReference ? normal_equations<kNumWithoutReference>(frame, rig)
                                         : normal_equations<kNumParameters>(frame, rig);
}

NecRows nec_rows(const NecFrame& frame, const Rig& rig, int count) {
    return count <= kNumWithoutReference ? rows_of<kNumWithoutReference>(frame, rig)
                                         : rows_of<kNumParameters>(frame, rig);
}

}  // namespace xcalib

#include "xcalib/nec.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "objective/gradient_rows.hpp"
#include "objective/nec_pass.hpp"
#include "objective/pass_rows.hpp"

namespace xcalib {
namespace {

// Floats in, double sums.
inline double squared(double x, double y) { return x * x + y * y; }

ImageRows rows_at(const Image& image, int y) {
    return {image.row(y - 1), image.row(y), image.row(y + 1), image.width};
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
    if (!(aa > 0 && bb > 0)) return std::numeric_limits<double>::quiet_NaN();
    return std::min(1.0, ab / std::sqrt(aa * bb));  // rounding aside, it is never above
}

EdgeField edge_field(const Image& image, float mean_magnitude, float relative_floor) {
    const float floor = relative_floor * mean_magnitude, cap = kEdgeCap * mean_magnitude;
    EdgeField field{image.width, image.height, {}, {}};
    for (std::vector<float>* part : {&field.x, &field.y}) {
        part->reserve(image.pixels.size() + kRoom);  // for those who read beyond the end
        part->assign(image.pixels.size(), 0.0f);
    }
    for (int y = 1; y + 1 < image.height; ++y) {
        const std::size_t offset = static_cast<std::size_t>(y) * image.width;
        clamped_gradients(rows_at(image, y), floor, cap, field.x.data() + offset,
                          field.y.data() + offset);
    }
    return field;
}

float mean_gradient(const Image& image) {
    if (image.width < 3 || image.height < 3) return 0.0f;
    double sum = 0;
    for (int y = 1; y + 1 < image.height; ++y) sum += sum_of_gradients(rows_at(image, y));
    return static_cast<float>(sum / (image.width - 2) / (image.height - 2));
}

void NecFrame::set_depth(Image known) {
    depth = std::move(known);
    reference_energy = 0.0;
    for (std::size_t i = 0; i < depth.pixels.size(); ++i) {
        if (depth.pixels[i] <= 0) reference.x[i] = reference.y[i] = 0.0f;
        reference_energy += squared(reference.x[i], reference.y[i]);
    }
}

NecFrame make_nec_frame(const Image& reference, const Image& source, const Image& depth,
                        const Rig& rig, float floor) {
    NecFrame frame;
    frame.floor = floor;
    frame.reference = edge_field(reference, mean_gradient(reference), floor);
    frame.depth = depth;
    frame.source = source;
    frame.source_mean = warped_mean_gradient(frame, rig);
    frame.set_depth(std::move(frame.depth));
    // The last row is read beyond its end.
    frame.reference.x.resize(frame.reference.x.size() + kRoom);
    frame.reference.y.resize(frame.reference.y.size() + kRoom);
    return frame;
}

NecValue value_of(const NecFrame& frame, const NecSums& sums) {
    constexpr double kMeanCosine = 2 / 3.14159265358979323846;  // of unrelated directions
    NecValue value;
    value.norm = std::sqrt(sums.aa * sums.vv);
    value.valid_share = frame.reference_energy > 0 ? sums.aa / frame.reference_energy : 0.0;
    if (value.norm <= 0) return value;
    value.nec = sums.av / value.norm;
    value.aligned = (sums.av - kMeanCosine * sums.magnitudes) / ((1 - kMeanCosine) * value.norm);
    return value;
}

NecValue evaluate_nec(const NecFrame& frame, const Rig& rig) {
    return value_of(frame, nec_sums(frame, rig));
}

NecNormalEquations equations_from_gram(const Eigen::MatrixXd& gram, const NecValue& value) {
    const Eigen::Index count = gram.rows() - 2;
    NecNormalEquations out;
    out.value = value;
    out.hessian = Eigen::MatrixXd::Zero(count, count);
    out.gradient = Eigen::VectorXd::Zero(count);
    if (value.norm <= 0) return out;
    // V = v / ||v||, dV = (dv - V (V . dv)) / ||v||: a rank-one correction of the plain sums.
    const double vv = gram(count, count), av = gram(count + 1, count);
    const Eigen::VectorXd v_dv = gram.block(count, 0, 1, count).transpose();
    const Eigen::VectorXd a_dv = gram.block(count + 1, 0, 1, count).transpose();
    out.hessian = (gram.topLeftCorner(count, count) - v_dv * v_dv.transpose() / vv) / vv;
    out.gradient = -(a_dv - v_dv * (av / vv)) / value.norm;
    return out;
}

NecNormalEquations nec_normal_equations(const NecFrame& frame, const Rig& rig,
                                        const Parameters& parameters) {
    const NecGram pass = nec_gram(frame, rig, parameters);
    return equations_from_gram(pass.gram, value_of(frame, pass.sums));
}

NecRows nec_rows(const NecFrame& frame, const Rig& rig, const Parameters& parameters) {
    Eigen::MatrixXd columns;
    const NecGram pass = nec_gram(frame, rig, parameters, nullptr, &columns);
    const int count = parameters.size();
    const Eigen::Index edges = columns.cols();
    const Eigen::VectorXd v = columns.row(count), a = columns.row(count + 1);
    const Eigen::VectorXd unit = v.normalized();
    NecRows out;
    out.residuals.resize(edges + 1);
    // s r: the sign drops out of J^T J. Reference edges without a partner move with nothing.
    out.residuals.head(edges) = a / std::sqrt(pass.sums.aa) - unit;
    out.residuals[edges] = std::sqrt(std::max(0.0, pass.sums.aa - a.squaredNorm()) / pass.sums.aa);
    out.jacobian = Eigen::MatrixXd::Zero(edges + 1, count);
    const Eigen::MatrixXd dv = columns.topRows(count).transpose();
    out.jacobian.topRows(edges) = -(dv - unit * (unit.transpose() * dv)) / v.norm();
    return out;
}

}  // namespace xcalib

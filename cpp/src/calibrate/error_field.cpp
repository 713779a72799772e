#include "xcalib/error_field.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "base/format.hpp"
#include "geometry/projector.hpp"
#include "objective/projection_derivative.hpp"
#include "xcalib/calibrate.hpp"

namespace xcalib {
namespace {

// Measured on rigs whose truth is known (docs/trust.md), as is what is below: weights of the
// squared errors that the gradients' scatter predicts, that halves which lie apart show, and that
// the lens would make which was not estimated,
constexpr double kPredicted = 0.6, kApart = 0.12, kMissed = 1.5;
// and the degrees of freedom of the error's distribution, of which the tails are heavier than a
// Gaussian's since the deviation itself is an estimate.
constexpr double kFreedom = 4.0;

constexpr double kFar = 1e9;  // [m]

// Errors longer than `length`, whose axes have the deviation `deviation`: Student's t in the plane.
double share_beyond(double length, double deviation) {
    const double ratio = length / deviation;
    return std::pow(1 + ratio * ratio / kFreedom, -kFreedom / 2);
}

double quantile_of(const std::vector<double>& deviations, double q) {
    double low = 0, high = 0;
    for (const double deviation : deviations) high = std::max(high, 100 * deviation);
    if (!std::isfinite(high)) return high;
    for (int round = 0; round < 60; ++round) {
        const double middle = 0.5 * (low + high);
        double beyond = 0;
        for (const double deviation : deviations) beyond += share_beyond(middle, deviation);
        (beyond > (1 - q) * static_cast<double>(deviations.size()) ? low : high) = middle;
    }
    return high;
}

}  // namespace

ExpectedError expected_error(const std::vector<double>& deviations) {
    if (deviations.empty()) return {};
    return {quantile_of(deviations, 0.5), quantile_of(deviations, 0.95)};
}

Eigen::MatrixXd ErrorField::jacobian(double x, double y, double depth) const {
    const Eigen::Matrix<double, 2, kNumParameters> all = warp_jacobian(rig, x, y, depth);
    Eigen::MatrixXd out(2, parameters.size());
    for (int i = 0; i < parameters.size(); ++i) out.col(i) = all.col(parameters[i]);
    return out;
}

double ErrorField::deviation_of(int parameter) const {
    for (int i = 0; i < parameters.size(); ++i)
        if (parameters[i] == parameter)
            return std::sqrt(kPredicted * std::max(0.0, covariance(i, i)));
    return 0.0;
}

double ErrorField::deviation(double x, double y, double inverse_depth) const {
    const double infinite = std::numeric_limits<double>::infinity();
    if (halves.size() != 2) return infinite;
    const double depth = 1 / std::max(inverse_depth, 1 / kFar);
    const Eigen::MatrixXd moves = jacobian(x, y, depth);
    const double predicted = (moves * covariance * moves.transpose()).trace();
    const double apart =
        (transfer(halves[0], x, y, depth) - transfer(halves[1], x, y, depth)).squaredNorm();
    const double missed = (moves * step).squaredNorm();
    const double variance =
        (kPredicted * predicted + kApart * disagreement * apart + kMissed * missed) / 2;
    return std::isfinite(variance) ? std::hypot(unit * std::sqrt(variance), floor) : infinite;
}

double ErrorField::length(double x, double y, double inverse_depth, double share) const {
    const double ratio = std::sqrt(kFreedom * (std::pow(1 - share, -2 / kFreedom) - 1));
    return ratio * deviation(x, y, inverse_depth);
}

bool ErrorField::sees(double x, double y, double inverse_depth) const {
    const Eigen::Vector2d at = transfer(rig, x, y, 1 / std::max(inverse_depth, 1 / kFar));
    return at.x() >= 0 && at.y() >= 0 && at.x() <= rig.source.width - 1 &&
           at.y() <= rig.source.height - 1;
}

ExpectedError ErrorField::at(double inverse_depth) const {
    constexpr int kColumns = 16, kRows = 12;
    std::vector<double> deviations;
    for (int i = 0; i < kColumns * kRows; ++i) {
        const double x = (i % kColumns + 0.5) * rig.reference.width / kColumns - 0.5,
                     y = (i / kColumns + 0.5) * rig.reference.height / kRows - 0.5;
        if (sees(x, y, inverse_depth)) deviations.push_back(deviation(x, y, inverse_depth));
    }
    return expected_error(deviations);
}

Image expected_error_map(const CalibrationReport& report, double depth, int width, int height,
                         double share) {
    if (!report.errors) throw std::invalid_argument("the report has no expected error");
    if (!(depth > 0 && share > 0 && share < 1 && width > 0 && height > 0))
        throw std::invalid_argument(
            format("depth = %g, share = %g, size %d x %d, expected a depth > 0, a share in (0, 1) "
                   "and a size of 1 x 1 px or more",
                   depth, share, width, height));
    const ErrorField& errors = *report.errors;
    const Pinhole& reference = errors.rig.reference;
    Image out(width, height, std::numeric_limits<float>::quiet_NaN());
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const double u = (x + 0.5) * reference.width / width - 0.5,
                         v = (y + 0.5) * reference.height / height - 0.5;
            if (errors.sees(u, v, 1 / depth))
                out.row(y)[x] = static_cast<float>(errors.length(u, v, 1 / depth, share));
        }
    return out;
}

}  // namespace xcalib

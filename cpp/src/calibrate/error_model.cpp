#include "calibrate/error_model.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "base/format.hpp"
#include "base/parallel.hpp"
#include "geometry/projector.hpp"
#include "objective/projection_derivative.hpp"
#include "solve/solve.hpp"
#include "xcalib/calibrate.hpp"

namespace xcalib {
namespace {

constexpr double kUnitWidth = 640;  // [px] of the reference, in whose pixels errors are given

// A frame tells of some directions only: so much of what all say goes to every direction alike.
constexpr double kShrinkage = 0.3;
// Measured on rigs whose truth is known (docs/trust.md), as are those below: shares of the squared
// error that the gradients' scatter predicts, that halves which lie apart show, and that the lens
// which was not estimated would make,
constexpr double kPredicted = 1.0, kApart = 0.2, kMissed = 0.5;
// what all frames share and none of these sees [working px],
constexpr double kFloor = 0.02;
// and the degrees of freedom of the error's distribution, of which the tails are heavier than a
// Gaussian's since the deviation itself is an estimate.
constexpr double kFreedom = 4.0;
// Standard deviations of k1 and k2 of lenses, which stand in for what was not estimated.
constexpr double kLens[] = {0.2, 0.1};

// What each frame says of a fit to all of them, by the directions in which a rig could be wrong.
struct Evidence {
    Eigen::MatrixXd hessian;                 // of all frames
    std::vector<Eigen::VectorXd> gradients;  // of each

    Eigen::VectorXd sum() const {
        Eigen::VectorXd sum = Eigen::VectorXd::Zero(hessian.rows());
        for (const Eigen::VectorXd& gradient : gradients) sum += gradient;
        return sum;
    }
};

Evidence evidence_of(const Level& level, const Rig& rig, const Directions& directions,
                     int num_threads) {
    constexpr double kLeastCurvature = 0.01;  // as in NecCost
    const Rig at_level = level.rig_at(rig);
    const std::size_t count = level.pairs.size();
    std::vector<Eigen::MatrixXd> hessians(count);
    Evidence out;
    out.gradients.resize(count);
    const Eigen::MatrixXd& basis = directions.basis;
    parallel_each(static_cast<int>(count), num_threads, [&](int i) {
        const ImagePair& pair = *level.pairs[i];
        const NecNormalEquations equations = pair.normal_equations(at_level, directions.parameters);
        const double curvature = std::max(pair.curvature(equations.value), kLeastCurvature);
        hessians[i] = level.weights[i] * curvature * basis.transpose() * equations.hessian * basis;
        out.gradients[i] = level.weights[i] * basis.transpose() * equations.gradient;
    });
    out.hessian = Eigen::MatrixXd::Zero(basis.cols(), basis.cols());
    for (const Eigen::MatrixXd& hessian : hessians) out.hessian += hessian;
    return out;
}

// W with W W^T = H^-1: in its columns every direction bends the cost alike.
Eigen::MatrixXd whitening_of(const Eigen::MatrixXd& hessian) {
    const Eigen::VectorXd unit = hessian.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(unit.asDiagonal() * hessian *
                                                               unit.asDiagonal());
    const Eigen::VectorXd values =
        eigen.eigenvalues().cwiseMax(1e-8 * eigen.eigenvalues()[hessian.rows() - 1]);
    return unit.asDiagonal() * eigen.eigenvectors() *
           values.cwiseSqrt().cwiseInverse().asDiagonal();
}

// Covariance of the sum of the gradients, in those columns, by how they scatter about their mean,
// which is 0 at the optimum but for what the last step left.
Eigen::MatrixXd scatter_of(const Evidence& evidence, const Eigen::MatrixXd& whitening) {
    const double count = static_cast<double>(evidence.gradients.size());
    const Eigen::VectorXd mean = evidence.sum() / count;
    Eigen::MatrixXd scatter = Eigen::MatrixXd::Zero(mean.size(), mean.size());
    for (const Eigen::VectorXd& gradient : evidence.gradients) {
        const Eigen::VectorXd step = whitening.transpose() * (gradient - mean);
        scatter += step * step.transpose() * count / (count - 1);
    }
    return scatter;
}

// What the frames say of where the truth lies.
struct Estimate {
    Eigen::VectorXd step;  // from the rig to the middle of it, by what was not estimated
    Eigen::MatrixXd covariance;
};

// (H + sP)^-1 (S + s^2 P) (H + sP)^-1, with S the covariance of the gradient, P what is known of
// lenses, and s what makes S of H: how the fit would scatter if the frames were drawn again.
Estimate estimate_of(const Evidence& evidence, const Eigen::VectorXd& prior) {
    const Eigen::Index size = evidence.hessian.rows();
    if (size == 0 || evidence.gradients.size() < 2)
        return {Eigen::VectorXd::Zero(size), Eigen::MatrixXd::Zero(size, size)};
    const double noise =
        scatter_of(evidence, whitening_of(evidence.hessian)).trace() / static_cast<double>(size);
    Eigen::MatrixXd hessian = evidence.hessian;
    hessian.diagonal() += noise * prior;
    const Eigen::MatrixXd whitening = whitening_of(hessian);
    Eigen::MatrixXd scatter = scatter_of(evidence, whitening);
    const double mean_scatter = scatter.trace() / static_cast<double>(size);
    scatter *= 1 - kShrinkage;
    scatter.diagonal().array() += kShrinkage * mean_scatter;
    scatter += noise * noise * whitening.transpose() * prior.asDiagonal() * whitening;
    const Eigen::VectorXd held = (prior.array() > 0).select(evidence.sum(), 0.0);
    return {-whitening * (whitening.transpose() * held),
            whitening * scatter * whitening.transpose()};
}

// What moved in the last solve, and the lens of the source where it was to be estimated and moved
// by less.
Directions directions_of(const Rig& rig, const Plan& plan) {
    const Moving moving = moving_parameters(2, 1, plan, rig);
    Directions out;
    std::vector<std::pair<int, int>> entries;  // parameter's place, direction
    std::vector<double> prior;
    for (int i = 0; i < moving.parameters.size(); ++i) {
        out.parameters.add(moving.parameters[i]);
        const int parameter = moving.parameters[i];
        const bool with_last = moving.gauge && parameter == kReferenceLogFy;
        const bool center = parameter == kReferenceCx || parameter == kReferenceCy;
        const double deviation = parameter == kReferenceLogFx ? kLogFocalDeviation
                                 : center                     ? kCenterDeviation
                                                              : INFINITY;
        if (!with_last) prior.push_back(moving.gauge ? 1 / (deviation * deviation) : 0);
        entries.emplace_back(i, static_cast<int>(prior.size()) - 1);
    }
    if (plan.estimates_lens && has_lens_parameters(rig.source.lens))
        for (int k = moving.lens_coefficients; k < 2; ++k) {
            entries.emplace_back(out.parameters.size(), static_cast<int>(prior.size()));
            out.parameters.add(kSourceK1 + k);
            prior.push_back(1 / (kLens[k] * kLens[k]));
        }
    out.basis = Eigen::MatrixXd::Zero(out.parameters.size(), static_cast<int>(prior.size()));
    for (const auto& [place, direction] : entries) out.basis(place, direction) = 1;
    out.prior = Eigen::Map<const Eigen::VectorXd>(prior.data(), static_cast<int>(prior.size()));
    return out;
}

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

constexpr double kFar = 1e9;  // [m]

}  // namespace

ExpectedError expected_error(const std::vector<double>& deviations) {
    if (deviations.empty()) return {};
    return {quantile_of(deviations, 0.5), quantile_of(deviations, 0.95)};
}

ErrorModel::ErrorModel(const WorkingImages& images, const Level& finest, const Rig& rig,
                       const Halves& halves, const Plan& plan)
    : rig_(rig), halves_(halves) {
    const double reduction = rig.reference.width / static_cast<double>(images.references[0].width);
    unit_ = kUnitWidth / rig.reference.width / rig.source_density().x();
    floor_ = kFloor * reduction * kUnitWidth / rig.reference.width;
    const auto frames = halves_of(images.size());
    const double count = static_cast<double>(images.size());
    disagreement_ = static_cast<double>(frames[0].size() * frames[1].size()) / (count * count);
    directions_ = directions_of(rig, plan);
    const Estimate estimate = estimate_of(
        evidence_of(finest, rig, directions_, plan.options.num_threads), directions_.prior);
    step_ = estimate.step;
    covariance_ = estimate.covariance;
    motion_ = Eigen::MatrixXd::Zero(covariance_.rows(), covariance_.cols());

    constexpr int kStep = 16;
    const std::vector<Image>& depths = images.pyramid.at(2).depths;
    for (const Image& depth : depths)
        for (int y = kStep / 2; y < depth.height; y += kStep)
            for (int x = kStep / 2; x < depth.width; x += kStep) {
                const double z = depth.row(y)[x];
                if (!(z > 0)) continue;
                const double u = (x + 0.5) * rig.reference.width / depth.width - 0.5,
                             v = (y + 0.5) * rig.reference.height / depth.height - 0.5;
                if (!sees(u, v, 1 / z)) continue;
                over_footage_.push_back(deviation(u, v, 1 / z));
                const Eigen::MatrixXd jacobian = unit_ * jacobian_at(u, v, z);
                motion_ += jacobian.transpose() * jacobian;
            }
    if (!over_footage_.empty()) motion_ /= static_cast<double>(over_footage_.size());
}

Eigen::MatrixXd ErrorModel::jacobian_at(double x, double y, double depth) const {
    const Eigen::Matrix<double, 2, kNumParameters> all = warp_jacobian(rig_, x, y, depth);
    Eigen::MatrixXd jacobian(2, directions_.parameters.size());
    for (int i = 0; i < directions_.parameters.size(); ++i)
        jacobian.col(i) = all.col(directions_.parameters[i]);
    return jacobian * directions_.basis;
}

double ErrorModel::deviation(double x, double y, double inverse_depth) const {
    const double infinite = std::numeric_limits<double>::infinity();
    const double depth = 1 / std::max(inverse_depth, 1 / kFar);
    if (!halves_.rigs[0] || !halves_.rigs[1]) return infinite;
    const Eigen::MatrixXd jacobian = jacobian_at(x, y, depth);
    const double predicted = (jacobian * covariance_ * jacobian.transpose()).trace();
    const double apart =
        (transfer(*halves_.rigs[0], x, y, depth) - transfer(*halves_.rigs[1], x, y, depth))
            .squaredNorm();
    const double missed = (jacobian * step_).squaredNorm();
    const double variance =
        (kPredicted * predicted + kApart * disagreement_ * apart + kMissed * missed) / 2;
    return std::isfinite(variance) ? std::hypot(unit_ * std::sqrt(variance), floor_) : infinite;
}

double ErrorModel::length(double x, double y, double inverse_depth, double share) const {
    const double ratio = std::sqrt(kFreedom * (std::pow(1 - share, -2 / kFreedom) - 1));
    return ratio * deviation(x, y, inverse_depth);
}

bool ErrorModel::sees(double x, double y, double inverse_depth) const {
    const Eigen::Vector2d at = transfer(rig_, x, y, 1 / std::max(inverse_depth, 1 / kFar));
    return at.x() >= 0 && at.y() >= 0 && at.x() <= rig_.source.width - 1 &&
           at.y() <= rig_.source.height - 1;
}

Image expected_error_map(const CalibrationReport& report, double depth, int width, int height,
                         double share) {
    if (!report.errors) throw std::invalid_argument("the report has no expected error");
    if (!(depth > 0 && share > 0 && share < 1 && width > 0 && height > 0))
        throw std::invalid_argument(
            format("depth = %g, share = %g, size %d x %d, expected a depth > 0, a share in (0, 1) "
                   "and a size of 1 x 1 px or more",
                   depth, share, width, height));
    const ErrorModel& errors = *report.errors;
    const Pinhole& reference = errors.rig().reference;
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

ExpectedError ErrorModel::at(double inverse_depth) const {
    constexpr int kColumns = 16, kRows = 12;
    std::vector<double> deviations;
    for (int i = 0; i < kColumns * kRows; ++i) {
        const double x = (i % kColumns + 0.5) * rig_.reference.width / kColumns - 0.5,
                     y = (i / kColumns + 0.5) * rig_.reference.height / kRows - 0.5;
        if (sees(x, y, inverse_depth)) deviations.push_back(deviation(x, y, inverse_depth));
    }
    return expected_error(deviations);
}

ExpectedError ErrorModel::over_footage() const { return expected_error(over_footage_); }

std::vector<std::string> ErrorModel::weak_directions() const {
    // What a parameter is called, in what unit, and from how far on it is worth a word.
    struct Name {
        int parameter;
        const char *name, *unit;
        double to_unit, noticeable;
    };
    const double width = rig_.source.width, height = rig_.source.height;
    const Name names[] = {{kTranslationZ, "t_z", "cm", 100, 1},
                          {kTranslationX, "t_x", "cm", 100, 1},
                          {kTranslationY, "t_y", "cm", 100, 1},
                          {kSourceLogFx, "fx", "%", 100, 0.5},
                          {kSourceLogFy, "fy", "%", 100, 0.5},
                          {kSourceCx, "cx", "px", width, 0.005 * width},
                          {kSourceCy, "cy", "px", height, 0.005 * height},
                          {kRotationX, "tilt", "deg", 57.29577951308232, 0.2},
                          {kRotationY, "pan", "deg", 57.29577951308232, 0.2},
                          {kSourceK1, "k1", "", 1, 0.02}};
    constexpr double kMoves = 0.1;  // [px]
    std::vector<std::string> out;
    if (over_footage_.empty()) return out;
    // In units in which each parameter moves the pixels alike, so that what hardly moves them is
    // told from what does not by rounding.
    const Eigen::VectorXd unit = motion_.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd scaled = unit.asDiagonal() * motion_ * unit.asDiagonal();
    const Eigen::MatrixXd inverse =
        unit.asDiagonal() *
        (scaled + 1e-10 * Eigen::MatrixXd::Identity(scaled.rows(), scaled.cols())).inverse() *
        unit.asDiagonal();
    for (const Name& first : names) {
        const Eigen::Index i = directions_.of(first.parameter);
        if (i < 0) continue;
        const double slide = kMoves * std::sqrt(std::max(0.0, inverse(i, i)));
        if (slide * first.to_unit < first.noticeable) continue;
        // The rest moves so that the pixels move least.
        const Name* with = nullptr;
        double most = 0, by = 0;
        for (const Name& second : names) {
            const Eigen::Index k = directions_.of(second.parameter);
            if (k < 0 || k == i) continue;
            const double moves = slide * inverse(k, i) / inverse(i, i);
            const double notice = std::abs(moves) * second.to_unit / second.noticeable;
            if (notice <= most) continue;
            most = notice;
            with = &second;
            by = moves;
        }
        std::string text = format("%s by %.2g %s", first.name, slide * first.to_unit, first.unit);
        if (with && most > 0.5)
            text +=
                format(", and %s by %+.2g %s with it", with->name, by * with->to_unit, with->unit);
        out.push_back(text);
    }
    return out;
}

double ErrorModel::deviation_of(int parameter) const {
    const Eigen::Index at = directions_.of(parameter);
    return at < 0 ? 0.0 : std::sqrt(kPredicted * std::max(0.0, covariance_(at, at)));
}

Eigen::Index Directions::of(int parameter) const {
    for (int i = 0; i < parameters.size(); ++i)
        if (parameters[i] == parameter) {
            Eigen::Index direction = 0;
            basis.row(i).maxCoeff(&direction);
            return direction;
        }
    return -1;
}

}  // namespace xcalib

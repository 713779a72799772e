#include "calibrate/error_model.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "base/format.hpp"
#include "base/parallel.hpp"
#include "calibrate/judging.hpp"
#include "solve/solve.hpp"

namespace xcalib {
namespace {

// A frame tells of some directions only: so much of what all say goes to every direction alike.
constexpr double kShrinkage = 0.3;
// What all frames share and nothing here sees [working px], as measured (see error_field.cpp).
constexpr double kFloor = 0.02;
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
// lenses and cameras, and s what makes S of H: how the fit would scatter if the frames were drawn
// again.
Estimate estimate_of(const Evidence& evidence, const Directions& directions) {
    const Eigen::VectorXd& prior = directions.prior;
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
    const Eigen::VectorXd held = directions.held.cwiseProduct(evidence.sum());
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
    int lenses = 0;
    if (plan.estimates_lens && has_lens_parameters(rig.source.lens))
        for (int k = moving.lens_coefficients; k < 2; ++k) {
            entries.emplace_back(out.parameters.size(), static_cast<int>(prior.size()));
            out.parameters.add(kSourceK1 + k);
            prior.push_back(1 / (kLens[k] * kLens[k]));
            ++lenses;
        }
    out.basis = Eigen::MatrixXd::Zero(out.parameters.size(), static_cast<int>(prior.size()));
    for (const auto& [place, direction] : entries) out.basis(place, direction) = 1;
    out.prior = Eigen::Map<const Eigen::VectorXd>(prior.data(), static_cast<int>(prior.size()));
    out.held = Eigen::VectorXd::Zero(out.prior.size());
    out.held.tail(lenses).setOnes();
    return out;
}

}  // namespace

ErrorModel::ErrorModel(const WorkingImages& images, const Level& finest, const Rig& rig,
                       const Halves& halves, const Plan& plan)
    : directions_(directions_of(rig, plan)) {
    const double reduction = rig.reference.width / static_cast<double>(images.references[0].width);
    const Estimate estimate =
        estimate_of(evidence_of(finest, rig, directions_, plan.options.num_threads), directions_);
    field_.rig = rig;
    if (halves.rigs[0] && halves.rigs[1]) field_.halves = {*halves.rigs[0], *halves.rigs[1]};
    field_.unit = kUnitWidth / rig.reference.width / rig.source_density().x();
    field_.floor = kFloor * reduction * kUnitWidth / rig.reference.width;
    const auto frames = halves_of(images.size());
    const double count = static_cast<double>(images.size());
    field_.disagreement =
        static_cast<double>(frames[0].size() * frames[1].size()) / (count * count);
    const Eigen::MatrixXd& basis = directions_.basis;
    field_.parameters = directions_.parameters;
    field_.covariance = basis * estimate.covariance * basis.transpose();
    field_.step = basis * estimate.step;

    motion_ = Eigen::MatrixXd::Zero(basis.cols(), basis.cols());
    constexpr int kStep = 16;
    const std::vector<Image>& depths = images.pyramid.at(2).depths;
    for (const Image& depth : depths)
        for (int y = kStep / 2; y < depth.height; y += kStep)
            for (int x = kStep / 2; x < depth.width; x += kStep) {
                const double z = depth.row(y)[x];
                if (!(z > 0)) continue;
                const double u = (x + 0.5) * rig.reference.width / depth.width - 0.5,
                             v = (y + 0.5) * rig.reference.height / depth.height - 0.5;
                if (!field_.sees(u, v, 1 / z)) continue;
                over_footage_.push_back(field_.deviation(u, v, 1 / z));
                const Eigen::MatrixXd jacobian = field_.unit * field_.jacobian(u, v, z) * basis;
                motion_ += jacobian.transpose() * jacobian;
            }
    if (!over_footage_.empty()) motion_ /= static_cast<double>(over_footage_.size());
}

ExpectedError ErrorModel::over_footage() const { return expected_error(over_footage_); }

std::vector<std::string> ErrorModel::weak_directions() const {
    // What a parameter is called, in what unit, and from how far on it is worth a word.
    struct Name {
        int parameter;
        const char *name, *unit;
        double to_unit, noticeable;
    };
    const double width = field_.rig.source.width, height = field_.rig.source.height;
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

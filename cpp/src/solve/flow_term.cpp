#include "solve/flow_term.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "base/parallel.hpp"
#include "geometry/projector.hpp"
#include "objective/projection_derivative.hpp"
#include "xcalib/gray.hpp"
#include "xcalib/warp.hpp"

namespace xcalib {
namespace {

constexpr double kSoft = 2.0 / 640;  // half widths
constexpr float kConfidence = 0.1f;  // below it a vector is not used
// Weights are shares of all confidence, but of no less than this share of all cells: where almost
// no flow is known, the term stays weak beside the images'.
constexpr double kMinWeight = 0.02;

double unit_of(const FlowTargets& targets) {
    const Pinhole& reference = targets.rig.reference;
    return 1 / targets.rig.source_density().x() / (0.5 * reference.width);
}

// Calls work(target, at) with where the target's pixel lies in the source now; those that come to
// lie behind the camera are left out.
template <class Work>
void for_each(const FlowTargets& targets, const Rig& rig, const Work& work) {
    for (const FlowTarget& target : targets.targets) {
        const Eigen::Vector2d at = transfer(rig, target.x, target.y, target.depth);
        if (at.allFinite()) work(target, at);
    }
}

// The most confident vector of each cell, as a target.
FlowTargets targets_of(const FlowField& field, const Image& depth, const Rig& rig) {
    FlowTargets out{rig, {}};
    const int side = std::max(1, kFlowCell / field.step);  // in vectors
    const auto depth_at = [&](double x, double y) {
        const long column = std::lround(x), row = std::lround(y);
        const bool inside = column >= 0 && row >= 0 && column < depth.width && row < depth.height;
        return inside ? depth.row(static_cast<int>(row))[column] : 0.0f;
    };
    for (int top = 0; top < field.height; top += side)
        for (int left = 0; left < field.width; left += side) {
            int best = top * field.width + left;
            for (int row = top; row < std::min(top + side, field.height); ++row)
                for (int column = left; column < std::min(left + side, field.width); ++column)
                    if (const int i = row * field.width + column;
                        field.confidence[i] > field.confidence[best])
                        best = i;
            if (!(field.confidence[best] > kConfidence)) continue;
            const float x = static_cast<float>(best % field.width * field.step + field.step / 2);
            const float y = static_cast<float>(best / field.width * field.step + field.step / 2);
            const float to_x = x + field.x[best], to_y = y + field.y[best];
            const float here = depth_at(x, y), there = depth_at(to_x, to_y);
            if (!(here > 0 && there > 0)) continue;
            const Eigen::Vector2d at = transfer(rig, to_x, to_y, there);
            if (!at.allFinite()) continue;
            out.targets.push_back({x, y, here, static_cast<float>(at.x()),
                                   static_cast<float>(at.y()), field.confidence[best]});
        }
    return out;
}

void require_field(const FlowField& field, const Image& image) {
    const std::size_t count = static_cast<std::size_t>(field.width) * field.height;
    if (!(field.step >= 1 && field.width == image.width / field.step &&
          field.height == image.height / field.step && field.x.size() == count &&
          field.y.size() == count && field.confidence.size() == count))
        throw std::invalid_argument(
            "flow has " + std::to_string(field.width) + "x" + std::to_string(field.height) +
            " vectors, expected one for each " + std::to_string(field.step) + "x" +
            std::to_string(field.step) + " px of " + std::to_string(image.width) + "x" +
            std::to_string(image.height));
    for (const float confidence : field.confidence)
        if (!(confidence >= 0 && confidence < 1.001f))  // a rounding beyond 1 is one
            throw std::invalid_argument("flow has the confidence " + std::to_string(confidence) +
                                        ", expected [0, 1]");
}

}  // namespace

double flow_value(const FlowTargets& targets, const Rig& rig) {
    const double unit = unit_of(targets);
    double value = 0;
    for_each(targets, rig, [&](const FlowTarget& target, const Eigen::Vector2d& at) {
        const double e = unit * (at - Eigen::Vector2d(target.u, target.v)).norm();
        value += target.weight * (std::hypot(e, kSoft) - kSoft);
    });
    return value;
}

FlowEquations flow_equations(const FlowTargets& targets, const Rig& rig,
                             const Parameters& parameters) {
    const double unit = unit_of(targets);
    const ProjectionDerivative derivative(rig);
    const int count = parameters.size();
    Eigen::MatrixXd hessian = Eigen::MatrixXd::Zero(count, count);
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(count), j(count);
    double value = 0;
    for_each(targets, rig, [&](const FlowTarget& target, const Eigen::Vector2d& at) {
        const Eigen::Vector2d e = unit * (at - Eigen::Vector2d(target.u, target.v));
        const double length = std::sqrt(e.squaredNorm() + kSoft * kSoft);
        value += target.weight * (length - kSoft);
        const SeenPoint point = seen_point(rig, target.x, target.y, target.depth);
        float row[kNumParameters];
        for (int axis = 0; axis < 2; ++axis) {
            derivative.chain<kNumParameters>(point, target.depth, axis == 0, axis == 1, row, 1);
            for (int i = 0; i < count; ++i) j[i] = unit * row[parameters[i]];
            hessian += target.weight / length * j * j.transpose();
            gradient += target.weight / length * e[axis] * j;
        }
    });
    return {value, hessian, gradient};
}

CompressedBlock FlowCost::linearized(const Rig& rig, const Parameters& free) const {
    const FlowEquations equations = flow_equations(targets_, rig, free);
    return compress(weight_ * equations.hessian, weight_ * equations.gradient,
                    weight_ * equations.value);
}

std::vector<FlowTargets> estimate_flow(const WorkingImages& images, int factor, const Rig& rig,
                                       const FlowEstimator& estimator, int max_shift,
                                       int num_threads) {
    const ReducedImages& level_images = images.pyramid.at(factor);
    const Level level = make_sizes(images, factor, rig);
    const Rig at_level = level.rig_at(rig);
    std::vector<FlowTargets> out(images.size());
    std::vector<double> cells(images.size());
    FlowOptions patches;
    patches.max_shift = max_shift;
    const auto estimate = [&](int i) {
        const Image& reference = level_images.references[i];
        const WarpedImage warped =
            warp(at_level, resize_area(images.sources[i], level.source_width, level.source_height),
                 level_images.depths[i]);
        std::vector<std::uint8_t> valid(warped.validity.size());
        std::transform(warped.validity.begin(), warped.validity.end(), valid.begin(),
                       [](std::uint8_t code) { return code == 0; });
        const FlowField field = estimator
                                    ? estimator(reference, warped.image, valid)
                                    : patch_flow(reference, warped.image, valid.data(), patches, 1);
        require_field(field, reference);
        out[i] = targets_of(field, level_images.depths[i], at_level);
        cells[i] = static_cast<double>(reference.pixels.size()) / (kFlowCell * kFlowCell);
    };
    // A caller's estimator may not be called by two threads at once.
    parallel_each(static_cast<int>(images.size()), estimator ? 1 : num_threads, estimate);
    double sum = 0, least = 0;
    for (std::size_t i = 0; i < out.size(); ++i) {
        least += kMinWeight * cells[i];
        for (const FlowTarget& target : out[i].targets) sum += target.weight;
    }
    for (FlowTargets& pair : out)
        for (FlowTarget& target : pair.targets)
            target.weight /= static_cast<float>(std::max(sum, least));
    return out;
}

}  // namespace xcalib

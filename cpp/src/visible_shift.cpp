#include "visible_shift.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "flow_term.hpp"
#include "median.hpp"

namespace xcalib {
namespace {

constexpr int kFactor = 2, kMaxShift = 12;  // [px of that level]
constexpr std::size_t kPairs = 4;
constexpr double kCells = 0.1;  // the least share that flow must tell of
constexpr double kShare = 0.9;  // of the pixels, which the shift is of at most
constexpr double kSoft = 0.5;   // [px of the level] up to which all residuals count alike

Eigen::RowVector3d place_of(const Pinhole& reference, double x, double y) {
    return {1, 2 * x / reference.width - 1, 2 * y / reference.height - 1};
}

Eigen::Vector2d mapped(const Rig& rig, double x, double y, double depth) {
    return project(rig.source, rig.R() * unproject(rig.reference, x, y, depth) + rig.t());
}

// Shifts linear in x and y with the least absolute residuals, by reweighting: what to multiply
// places with.
Eigen::Matrix<double, 3, 2> linear_part(const Eigen::MatrixX3d& places,
                                        const Eigen::MatrixX2d& shifts,
                                        const Eigen::VectorXd& weights) {
    constexpr int kRounds = 8;
    Eigen::VectorXd now = weights;
    Eigen::Matrix<double, 3, 2> fitted;
    for (int round = 0; round < kRounds; ++round) {
        const Eigen::Matrix3d normal = places.transpose() * now.asDiagonal() * places;
        fitted = normal.ldlt().solve(places.transpose() * now.asDiagonal() * shifts);
        now = weights.array() / (shifts - places * fitted).rowwise().norm().array().max(kSoft);
    }
    return fitted;
}

}  // namespace

double visible_shift(const WorkingImages& images, const Rig& rig, int num_threads) {
    const WorkingImages few = images.spread(kPairs);
    const std::vector<FlowTargets> flow =
        estimate_flow(few, kFactor, rig, nullptr, kMaxShift, num_threads);
    std::size_t told = 0;
    for (const FlowTargets& pair : flow) told += pair.targets.size();

    // Where the source is seen, whether or not flow can tell.
    std::vector<Eigen::RowVector3d> seen;
    double cells = 0;
    for (std::size_t i = 0; i < flow.size(); ++i) {
        const Rig& at = flow[i].rig;
        const Image& depth = few.pyramid.at(kFactor).depths[i];
        for (int y = kFlowCell / 2; y < depth.height; y += kFlowCell)
            for (int x = kFlowCell / 2; x < depth.width; x += kFlowCell) {
                ++cells;
                if (!(depth.row(y)[x] > 0)) continue;
                const Eigen::Vector2d point = mapped(at, x, y, depth.row(y)[x]);
                if (point.x() >= 0 && point.y() >= 0 && point.x() <= at.source.width - 1 &&
                    point.y() <= at.source.height - 1)
                    seen.push_back(place_of(at.reference, x, y));
            }
    }
    if (seen.empty() || static_cast<double>(told) < std::max(3.0, kCells * cells))
        return std::numeric_limits<double>::quiet_NaN();

    Eigen::MatrixX3d places(told, 3);
    Eigen::MatrixX2d shifts(told, 2);
    Eigen::VectorXd weights(told);
    Eigen::Index row = 0;
    for (const FlowTargets& pair : flow) {
        const double reference_px = pair.rig.reference.fx / pair.rig.source.fx;
        for (const FlowTarget& target : pair.targets) {
            const Eigen::Vector2d point = mapped(pair.rig, target.x, target.y, target.depth);
            places.row(row) = place_of(pair.rig.reference, target.x, target.y);
            shifts.row(row) = reference_px * (Eigen::Vector2d(target.u, target.v) - point);
            weights[row++] = target.weight;
        }
    }
    const auto fitted = linear_part(places, shifts, weights);
    std::vector<double> lengths;
    for (const Eigen::RowVector3d& place : seen) lengths.push_back((place * fitted).norm());
    return kFactor * quantile(std::move(lengths), kShare);
}

}  // namespace xcalib

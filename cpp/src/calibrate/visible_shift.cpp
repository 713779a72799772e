#include "calibrate/visible_shift.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <limits>

#include "base/median.hpp"
#include "calibrate/judging.hpp"
#include "geometry/projector.hpp"
#include "solve/flow_term.hpp"

namespace xcalib {
namespace {

constexpr int kMaxShift = 12;  // [px of the level that is judged]
constexpr std::size_t kPairs = 4;
constexpr double kCells = 0.1;  // share of those that the source sees for which flow must be known
constexpr double kShare = 0.9;  // of the pixels, which are shifted by no more than the result
constexpr double kSoft = 0.5;   // [px of the level] up to which all residuals count alike

// Where the rig maps a reference pixel, and whether the source sees it there.
struct Place {
    Eigen::Vector2d at;
    bool seen;

    Place(const Rig& rig, double x, double y, double depth) {
        at = transfer(rig, x, y, depth);
        seen = at.x() >= 0 && at.y() >= 0 && at.x() <= rig.source.width - 1 &&
               at.y() <= rig.source.height - 1;
    }
};

// The row of a pixel in the linear system: a shift that is linear in x and y is row * coefficients.
Eigen::RowVector3d row_of(const Pinhole& reference, double x, double y) {
    return {1, 2 * x / reference.width - 1, 2 * y / reference.height - 1};
}

// The shifts' coefficients with the least absolute residuals, by reweighting.
Eigen::Matrix<double, 3, 2> linear_part(const std::vector<Eigen::RowVector3d>& rows,
                                        const std::vector<Eigen::RowVector2d>& shifts,
                                        const std::vector<double>& weights) {
    // Slopes that are known in a strip only are not carried over the whole image.
    constexpr double kRidge = 0.01;
    constexpr int kRounds = 8;
    Eigen::Matrix<double, 3, 2> fitted = Eigen::Matrix<double, 3, 2>::Zero();
    for (int round = 0; round < kRounds; ++round) {
        Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
        Eigen::Matrix<double, 3, 2> right = Eigen::Matrix<double, 3, 2>::Zero();
        for (std::size_t i = 0; i < rows.size(); ++i) {
            const double residual = round > 0 ? (shifts[i] - rows[i] * fitted).norm() : 0.0;
            const double weight = weights[i] / std::max(residual, kSoft);
            normal += weight * rows[i].transpose() * rows[i];
            right += weight * rows[i].transpose() * shifts[i];
        }
        normal.diagonal().tail<2>().array() += kRidge * normal(0, 0);
        fitted = normal.ldlt().solve(right);
    }
    return fitted;
}

}  // namespace

double visible_shift(const WorkingImages& images, const Rig& rig, int num_threads) {
    const WorkingImages few = images.spread(kPairs);
    const std::vector<FlowTargets> flow =
        estimate_flow(few, kJudgedFactor, rig, nullptr, kMaxShift, num_threads);
    std::vector<Eigen::RowVector3d> seen, known;
    std::vector<Eigen::RowVector2d> shifts;
    std::vector<double> weights;
    for (std::size_t i = 0; i < flow.size(); ++i) {
        const Rig& here = flow[i].rig;
        const Image& depth = few.pyramid.at(kJudgedFactor).depths[i];
        for (int y = kFlowCell / 2; y < depth.height; y += kFlowCell)
            for (int x = kFlowCell / 2; x < depth.width; x += kFlowCell)
                if (Place(here, x, y, depth.row(y)[x]).seen)
                    seen.push_back(row_of(here.reference, x, y));
        const double reference_px = 1 / here.source_density().x();
        for (const FlowTarget& target : flow[i].targets) {
            const Place place(here, target.x, target.y, target.depth);
            if (!place.seen) continue;
            known.push_back(row_of(here.reference, target.x, target.y));
            shifts.emplace_back(reference_px *
                                (Eigen::Vector2d(target.u, target.v) - place.at).transpose());
            weights.push_back(target.weight);
        }
    }
    if (known.empty() ||
        static_cast<double>(known.size()) < kCells * static_cast<double>(seen.size()))
        return std::numeric_limits<double>::quiet_NaN();
    const Eigen::Matrix<double, 3, 2> fitted = linear_part(known, shifts, weights);
    std::vector<double> lengths;
    for (const Eigen::RowVector3d& row : seen) lengths.push_back((row * fitted).norm());
    return kJudgedFactor * quantile(std::move(lengths), kShare);
}

}  // namespace xcalib

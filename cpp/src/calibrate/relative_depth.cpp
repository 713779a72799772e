#include "calibrate/relative_depth.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "solve/solve.hpp"

namespace xcalib {
namespace {

// Share of the way to infinity that a shift may bring what is far.
constexpr double kNearInfinity = 0.98;

// The least of f over [low, high]: on a grid, then by golden section beside its best point.
double minimum(const std::function<double(double)>& f, double low, double high, int points,
               int steps) {
    int best = 0;
    double least = INFINITY;
    const double spacing = (high - low) / (points - 1);
    for (int i = 0; i < points; ++i)
        if (const double value = f(low + i * spacing); value < least) {
            least = value;
            best = i;
        }
    const double ratio = (std::sqrt(5.0) - 1) / 2;
    double a = low + std::max(0, best - 1) * spacing;
    double b = low + std::min(points - 1, best + 1) * spacing;
    double left = b - ratio * (b - a), right = a + ratio * (b - a);
    double at_left = f(left), at_right = f(right);
    for (int i = 0; i < steps; ++i) {
        if (at_left < at_right) {
            b = right;
            right = left;
            at_right = at_left;
            at_left = f(left = b - ratio * (b - a));
        } else {
            a = left;
            left = right;
            at_left = at_right;
            at_right = f(right = a + ratio * (b - a));
        }
    }
    return at_left < at_right ? left : right;
}

}  // namespace

Rig with_shifted_depth(const Rig& rig, double shift) {
    const Eigen::Matrix3d K = rig.source.K();
    Eigen::Matrix3d moved = rig.R();
    moved.col(2) -= shift * rig.t();
    const Eigen::Matrix3d A = K * moved;
    // A = U R' with U an upper triangle: U U^T = A A^T, by a Cholesky factor from the last row up.
    const Eigen::Matrix3d reversed = (A * A.transpose()).reverse();
    const Eigen::Matrix3d lower = reversed.llt().matrixL();
    const Eigen::Matrix3d U = lower.reverse();
    const Eigen::Matrix3d inverse = U.inverse();
    Rig out = rig;
    out.source = Pinhole::from_K(rig.source.width, rig.source.height, U);
    out.source.lens = rig.source.lens;  // which makes it approximate
    out.source_from_reference.rotation = Eigen::Quaterniond(inverse * A).normalized();
    out.source_from_reference.translation = inverse * K * rig.t();
    return out;
}

WorkingImages with_shifted_depth(const WorkingImages& images, double shift) {
    WorkingImages out = images;
    for (auto& [factor, level] : out.pyramid)
        for (Image& depth : level.depths)
            for (float& d : depth.pixels)
                if (d > 0) d = static_cast<float>(1 / std::max(1.0 / d + shift, 1e-4));
    return out;
}

double farthest_inverse_depth(const WorkingImages& images) {
    std::vector<float> known;
    for (const Image& depth : images.pyramid.at(kCoarse).depths)
        for (const float d : depth.pixels)
            if (d > 0) known.push_back(d);
    const auto place = known.begin() + static_cast<std::ptrdiff_t>(0.98 * (known.size() - 1));
    std::nth_element(known.begin(), place, known.end());
    return 1.0 / *place;
}

double ordinary_shift(const Rig& rig, double farthest) {
    // Usual deviations: shares of the image size, and of the focal length.
    constexpr double kCentre = 0.02, kAspect = 0.005, kSkew = 0.005;
    const auto strangeness = [&](double shift) {
        const Rig shifted = with_shifted_depth(rig, shift);
        const SolverParameters::Camera camera = solver_from_rig(shifted).source;
        const double x = (camera.center[0] - 0.5) / kCentre;
        const double y = (camera.center[1] - 0.5) / kCentre;
        const Eigen::Vector2d scale = shifted.source.pixels_per_radian();
        const double aspect = std::log(scale.y() / scale.x()) / kAspect;
        const double skew = camera.skew_share[0] * rig.source.width / scale.x() / kSkew;
        const double from_start = shift / farthest;
        return x * x + y * y + aspect * aspect + skew * skew + from_start * from_start;
    };
    return minimum(strangeness, -kNearInfinity * farthest, 8 * farthest, 60, 40);
}

double best_shift(const WorkingImages& all_images, const Plan& plan, double farthest, Rig& rig) {
    // The error that a shift leaves once the rig is solved again shows at full size only.
    constexpr std::size_t kFrames = 8;
    WorkingImages images = all_images.spread(kFrames);
    // Without the edges of the depth as given: all shifts compare the same pixels.
    if (images.parts.depth_edges)
        for (Image& depth : images.pyramid.at(1).depths) depth = without_depth_edges(depth);
    images.parts.depth_edges = false;
    Plan quick = plan;
    quick.options.max_iterations = std::min(plan.options.max_iterations, 12);
    const int num_threads = plan.options.num_threads;
    const Level start = make_level(images, 1, rig, num_threads);
    const double limit = share_limit(pooled(start, rig, num_threads).valid_share);
    Rig found = rig;
    double most = -INFINITY;
    const auto disagreement = [&](double shift) {
        Rig solved = found;  // from the best so far, the nearest that is known
        const Level level = make_level(with_shifted_depth(images, shift), 1, solved, num_threads);
        const double nec = solve_level(level, {}, 2, limit, 1e-5, quick, found, solved).nec;
        if (nec > most) {
            most = nec;
            found = solved;
        }
        return -nec;
    };
    disagreement(0.0);
    const double shift = minimum(disagreement, -kNearInfinity * farthest, 4 * farthest, 8, 8);
    rig = found;
    return shift;
}

}  // namespace xcalib

#include "register/cells.hpp"

#include <algorithm>
#include <cmath>

#include "geometry/projector.hpp"

namespace xcalib {
namespace {

// Depth of one surface varies by so much between neighbours, by noise or by slant.
constexpr double kRelativeTolerance = 0.05;
// What moves by less than this against its surroundings, in cells, hides nothing.
constexpr double kMinShift = 0.5;
// Where the reference is far finer, more cells show no more.
constexpr double kMaxPerPixel = 2;
constexpr double kMaxCells = 4e6;  // of which the kernel can count

// How far apart reference pixels are in the source, of something far, along x and y. [px] Where
// lenses bend, that varies over the image, and the farthest apart count: nothing is to be seen
// between them.
Eigen::Vector2d steps_of(const Rig& rig) {
    Eigen::Vector2d steps = rig.source_density();
    if (!rig.reference.lens.bends() && !rig.source.lens.bends()) return steps;
    constexpr double kFar = 1e6;  // [m]
    constexpr int kPlaces = 16;   // to a side
    const auto visible = [&](const Eigen::Vector2d& at) {
        return at.x() >= 0 && at.y() >= 0 && at.x() <= rig.source.width - 1 &&
               at.y() <= rig.source.height - 1;
    };
    for (int i = 0; i <= kPlaces; ++i)
        for (int k = 0; k <= kPlaces; ++k) {
            const double x = (rig.reference.width - 2.0) * k / kPlaces;
            const double y = (rig.reference.height - 2.0) * i / kPlaces;
            const Eigen::Vector2d here = transfer(rig, x, y, kFar);
            const Eigen::Vector2d right = transfer(rig, x + 1, y, kFar) - here;
            const Eigen::Vector2d down = transfer(rig, x, y + 1, kFar) - here;
            if (!visible(here) || !right.allFinite() || !down.allFinite()) continue;
            steps = steps.cwiseMax(right.cwiseAbs().cwiseMax(down.cwiseAbs()));
        }
    return steps;
}

}  // namespace

CellGrid::CellGrid(const Rig& rig) {
    const Eigen::Vector2d density = steps_of(rig);
    double x = std::min(kMaxPerPixel, 1 / density.x());
    double y = std::min(kMaxPerPixel, 1 / density.y());
    const double cells = (rig.source.width * x + 2) * (rig.source.height * y + 2);
    const double reduction = std::min(1.0, std::sqrt(kMaxCells / cells));
    x *= reduction;
    y *= reduction;
    // One more than needed: the last point's cell is computed in float.
    width = static_cast<int>((rig.source.width - 1) * x) + 2;
    height = static_cast<int>((rig.source.height - 1) * y) + 2;
    per_pixel_x = static_cast<float>(x);
    per_pixel_y = static_cast<float>(y);
    relative_tolerance = static_cast<float>(kRelativeTolerance);
    const Eigen::Vector2d scale = rig.source.pixels_per_radian();
    const double cells_x = x * scale.x(), cells_y = y * scale.y();  // per radian
    along_x = cells_x * std::abs(rig.t().x()) >= cells_y * std::abs(rig.t().y());
    absolute_tolerance =
        static_cast<float>(kMinShift / (std::max(cells_x, cells_y) * rig.t().norm()));
}

}  // namespace xcalib

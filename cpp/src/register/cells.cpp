#include "register/cells.hpp"

#include <algorithm>
#include <cmath>

namespace xcalib {
namespace {

// Depth of one surface varies by so much between neighbours, by noise or by slant.
constexpr double kRelativeTolerance = 0.05;
// What moves by less than this against its surroundings, in cells, hides nothing.
constexpr double kMinShift = 0.5;
// Where the reference is far finer, more cells show no more.
constexpr double kMaxPerPixel = 2;
constexpr double kMaxCells = 4e6;  // of which the kernel can count

}  // namespace

CellGrid::CellGrid(const Rig& rig) {
    const Eigen::Vector2d density = rig.source_density();
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

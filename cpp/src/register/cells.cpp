#include "register/cells.hpp"

#include <algorithm>
#include <cmath>

namespace xcalib {
namespace {

// Depth of one surface varies by so much between neighbours, by noise or by slant.
constexpr double kRelativeTolerance = 0.05;
// What moves by less than this against its surroundings, in cells, hides nothing.
constexpr double kLeastShift = 0.5;
// Where the reference is far finer, more cells tell no more.
constexpr double kMostPerPixel = 2;
constexpr double kMostCells = 4e6;  // of which the kernel can count

}  // namespace

CellGrid::CellGrid(const Rig& rig) {
    double x = std::min(kMostPerPixel, rig.reference.fx / rig.source.fx);
    double y = std::min(kMostPerPixel, rig.reference.fy / rig.source.fy);
    const double cells = (rig.source.width * x + 2) * (rig.source.height * y + 2);
    const double reduction = std::min(1.0, std::sqrt(kMostCells / cells));
    x *= reduction;
    y *= reduction;
    // One more than needed: the last point's cell is computed in float.
    width = static_cast<int>((rig.source.width - 1) * x) + 2;
    height = static_cast<int>((rig.source.height - 1) * y) + 2;
    per_pixel_x = static_cast<float>(x);
    per_pixel_y = static_cast<float>(y);
    relative_tolerance = static_cast<float>(kRelativeTolerance);
    const double moved_x = x * rig.source.fx * std::abs(rig.t().x());
    const double moved_y = y * rig.source.fy * std::abs(rig.t().y());
    along_x = moved_x >= moved_y;
    absolute_tolerance = static_cast<float>(
        kLeastShift / (std::max(x * rig.source.fx, y * rig.source.fy) * rig.t().norm()));
}

}  // namespace xcalib

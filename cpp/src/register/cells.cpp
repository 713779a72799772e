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

// Epipolar lines that are steeper are no longer nearly along rows.
constexpr double kMaxSlope = 0.25;
constexpr int kMaxRowCells = 1 << 16;
// Nothing is expected to be nearer than so many baselines: its shadow may be cut short.
constexpr double kNearest = 12;

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

RowGrid::RowGrid(const Rig& rig) : height_(rig.reference.height) {
    constexpr double kFar = 1e6;  // [m]
    const double near = 2 * kNearest * rig.t().norm();
    double step = 0, direction = 0, back = 0;
    for (int i = 0; i <= kBands; ++i)
        for (int k = 0; k <= kBands; ++k) {
            const double x = (rig.reference.width - 1.0) * k / kBands;
            const double y = (height_ - 1.0) * i / kBands;
            const Eigen::Vector2d here = transfer(rig, x, y, kFar);
            const bool visible = here.x() >= 0 && here.y() >= 0 &&
                                 here.x() <= rig.source.width - 1 &&
                                 here.y() <= rig.source.height - 1;
            Eigen::Matrix2d slope;
            slope.col(0) = transfer(rig, x + 0.5, y, kFar) - transfer(rig, x - 0.5, y, kFar);
            slope.col(1) = transfer(rig, x, y + 0.5, kFar) - transfer(rig, x, y - 0.5, kFar);
            // In the reference, something so near lies this far from what it hides.
            const Eigen::Vector2d moved =
                slope.inverse() * (transfer(rig, x, y, near) - here).eval();
            if (!visible || !slope.allFinite() || !moved.allFinite()) continue;
            const double along = slope.col(0).cwiseAbs().maxCoeff();
            if (step == 0) {
                along_u = along == std::abs(slope(0, 0));
                direction = slope(along_u ? 0 : 1, 0);
                back = moved.x();
            }
            if (slope(along_u ? 0 : 1, 0) * direction <= 0 ||
                2 * std::abs(slope(along_u ? 0 : 1, 0)) < slope.col(0).norm() ||
                moved.x() * back <= 0 || std::abs(moved.y()) > kMaxSlope * std::abs(moved.x()))
                return;
            step = std::max(step, along);
            const double depth = (rig.R() * unproject(rig.reference, x, y, near) + rig.t()).z();
            fall_[i][k] = static_cast<float>(moved.y() * depth);
        }
    const double size = along_u ? rig.source.width : rig.source.height;
    if (step == 0 || size / step > kMaxRowCells) return;
    // Where pixels are farthest apart in the source they are a cell apart.
    per_pixel = static_cast<float>((direction > 0 ? 1 : -1) / step);
    shift = static_cast<float>(kBefore + 1 + (direction > 0 ? 0 : (size - 1) / step));
    count = kBefore + static_cast<int>(size / step) + 4;
    near_lies_back = back < 0;
    farthest_ = static_cast<float>(2 / near);
    // Where shadows fall both ways, those that fall the other way are not found.
    constexpr float kMaxOther = 2;  // [rows]
    for (int y = 0; y < height_; y += rows_at_a_time()) {
        const Shadows of_rows = shadows(y, std::min(height_, y + rows_at_a_time()));
        for (const float fall : of_rows.shortest)
            if (fall * farthest_ < -kMaxOther) return;
    }
    serves = true;
}

int RowGrid::rows_at_a_time() const { return std::max(64, height_ / 8); }

Shadows RowGrid::shadows(int begin, int end) const {
    const double rows = std::max(1, height_ - 1);
    const int first = static_cast<int>(std::floor(kBands * begin / rows));
    const int last = std::min(kBands, static_cast<int>(std::ceil(kBands * (end - 1) / rows)));
    Shadows out;
    float least = 0, most = 0;
    for (int i = first; i <= last; ++i)
        for (const float fall : fall_[i]) {
            least = std::min(least, fall);
            most = std::max(most, fall);
        }
    out.down = most >= -least;
    out.longest_of_all = std::max(most, -least);
    for (int k = 0; k < kBands; ++k) {
        out.shortest[k] = out.longest_of_all;
        out.longest[k] = -out.longest_of_all;
        for (int i = first; i <= last; ++i)
            for (const float fall : {fall_[i][k], fall_[i][k + 1]}) {
                const float as_counted = out.down ? fall : -fall;
                out.shortest[k] = std::min(out.shortest[k], as_counted);
                out.longest[k] = std::max(out.longest[k], as_counted);
            }
    }
    const double reach = std::ceil(out.longest_of_all * farthest_);
    out.reach = std::min(static_cast<int>(reach), kMaxReach);
    return out;
}

}  // namespace xcalib

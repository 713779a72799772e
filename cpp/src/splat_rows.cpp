#include <algorithm>

#include "kernel_targets.hpp"
#include "register_rows.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "splat_rows.cpp"
#include <hwy/foreach_target.h>

#include "project-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace xcalib {
namespace HWY_NAMESPACE {
namespace {

// Raises cells to the nearness of points, whose u and v are in cells.
HWY_INLINE void splat(const CellGrid& grid, Float depth, const Points& p,
                      Nearness* HWY_RESTRICT cells) {
    const FloatTag d;
    // Of positive floats the greater has the greater bits.
    const Int bits = hn::ShiftRight<16>(hn::BitCast(IntTag(), p.inverse_z));
    const Mask ahead = in_front(depth, p);
#if HWY_TARGET != HWY_SCALAR
    // Pixels of one surface fall into neighbouring cells: all are written at once, where this moves
    // none by more than half a cell.
    const Float start = hn::Sub(p.u, hn::Iota(d, 0.0f));
    const float u = hn::ExtractLane(start, kLanes / 2), v = hn::ExtractLane(p.v, kLanes / 2);
    const Float apart = hn::Max(hn::Abs(hn::Sub(start, set(u))), hn::Abs(hn::Sub(p.v, set(v))));
    const float last_u = static_cast<float>(grid.width - kLanes);
    const float last_v = static_cast<float>(grid.height - 1);
    if (u >= 0 && u <= last_u && v >= 0 && v <= last_v &&
        hn::AllTrue(d, hn::And(ahead, hn::Lt(apart, set(0.5))))) {
        const ShortTag shorts;
        Nearness* to = cells + static_cast<std::ptrdiff_t>(v) * grid.width + static_cast<int>(u);
        hn::StoreU(hn::Max(hn::LoadU(shorts, to), hn::DemoteTo(shorts, bits)), shorts, to);
        return;
    }
#endif
    const Float zero = hn::Zero(d);
    const Mask in_x = hn::And(hn::Ge(p.u, zero), hn::Lt(p.u, set(grid.width - 1.0)));
    const Mask in_y = hn::And(hn::Ge(p.v, zero), hn::Lt(p.v, set(grid.height - 1.0)));
    const Mask inside = hn::And(hn::And(in_x, in_y), ahead);
    if (hn::AllFalse(d, inside)) return;
    HWY_ALIGN std::int32_t index[kLanes], nearness[kLanes];
    const Int cell =
        cells_of(grid, hn::IfThenElseZero(inside, p.u), hn::IfThenElseZero(inside, p.v));
    hn::Store(hn::IfThenElse(hn::RebindMask(IntTag(), inside), cell, set(grid.count())), IntTag(),
              index);
    hn::Store(bits, IntTag(), nearness);
    for (int i = 0; i < kLanes; ++i) {
        Nearness& at = cells[index[i]];
        at = std::max(at, static_cast<Nearness>(nearness[i]));
    }
}

void splat_rows(const Reprojection& reprojection, const DepthView& depth, const CellGrid& grid,
                int begin, int end, Nearness* HWY_RESTRICT cells) {
    const int width = depth.view.width;
    for (int y = begin; y < end; ++y) {
        const Row row(reprojection, y, 0, grid.per_pixel_x, grid.per_pixel_y);
        const DepthRow depths(depth, y);
        Float along = hn::Iota(FloatTag(), 0.0f);
        for (int x = 0; x < width; x += kLanes, along = hn::Add(along, set(double{kLanes}))) {
            const Float z = depths.load(x, width - x);
            splat(grid, z, project_roughly(row, z, along), cells);
        }
    }
}

void join_cells(const CellGrid& grid, const Nearness* parts, int count, int begin, int end,
                Nearness* out) {
    const hn::ScalableTag<Nearness> d;
    using Cells = hn::Vec<decltype(d)>;
    const int lanes = static_cast<int>(hn::Lanes(d)), width = grid.width;
    const std::size_t size = cells_with_room(grid);
    const auto nearest = [&](const Nearness* cell) HWY_ATTR {
        Cells value = hn::LoadU(d, cell);
        for (int i = 1; i < count; ++i) value = hn::Max(value, hn::LoadU(d, cell + i * size));
        return value;
    };
    const auto nearest_one = [&](const Nearness* cell) {
        Nearness value = *cell;
        for (int i = 1; i < count; ++i) value = std::max(value, cell[i * size]);
        return value;
    };
    for (int y = begin; y < end; ++y) {
        const Nearness* row = parts + static_cast<std::size_t>(y) * width;
        // Beyond the border lies the row, or the cell, itself, which fills nothing.
        const Nearness* above = y > 0 ? row - width : row;
        const Nearness* below = y + 1 < grid.height ? row + width : row;
        Nearness* to = out + static_cast<std::size_t>(y) * width;
        const auto join_one = [&](int x) {
            const Nearness here = nearest_one(row + x);
            const Nearness left = x > 0 ? nearest_one(row + x - 1) : here;
            const Nearness right = x + 1 < width ? nearest_one(row + x + 1) : here;
            const Nearness across = std::min(left, right);
            const Nearness along = std::min(nearest_one(above + x), nearest_one(below + x));
            to[x] = std::max(here, std::max(across, along));
        };
        int x = 1;
        join_one(0);
        for (; x + lanes < width; x += lanes) {
            const Cells across = hn::Min(nearest(row + x - 1), nearest(row + x + 1));
            const Cells along = hn::Min(nearest(above + x), nearest(below + x));
            hn::StoreU(hn::Max(nearest(row + x), hn::Max(across, along)), d, to + x);
        }
        for (; x < width; ++x) join_one(x);
    }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace xcalib
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace xcalib {
namespace {

HWY_EXPORT(splat_rows);
HWY_EXPORT(join_cells);

}  // namespace

void splat_rows(const Reprojection& reprojection, const DepthView& depth, const CellGrid& grid,
                int begin, int end, Nearness* cells) {
    HWY_DYNAMIC_DISPATCH(splat_rows)(reprojection, depth, grid, begin, end, cells);
}

void join_cells(const CellGrid& grid, const Nearness* parts, int count, int begin, int end,
                Nearness* out) {
    HWY_DYNAMIC_DISPATCH(join_cells)(grid, parts, count, begin, end, out);
}

}  // namespace xcalib
#endif

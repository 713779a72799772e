#include <algorithm>
#include <cmath>

#include "base/kernel_targets.hpp"
#include "register/register_rows.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "register/splat_rows.cpp"
#include <hwy/foreach_target.h>

#include "register/locate-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace xcalib {
namespace HWY_NAMESPACE {
namespace {

// Upper halves of 1/z. Of positive floats the greater has the greater bits.
HWY_INLINE Int nearness_of(const Points& p) {
    return hn::ShiftRight<16>(hn::BitCast(IntTag(), p.inverse_z));
}

// Raises cells to the nearness of points, whose u and v are in cells.
HWY_INLINE void splat(const CellGrid& grid, Float depth, const Points& p,
                      Nearness* HWY_RESTRICT cells) {
    const FloatTag d;
    const Float zero = hn::Zero(d);
    const Mask in_x = hn::And(hn::Ge(p.u, zero), hn::Lt(p.u, set(grid.width - 1.0)));
    const Mask in_y = hn::And(hn::Ge(p.v, zero), hn::Lt(p.v, set(grid.height - 1.0)));
    const Mask inside = hn::And(hn::And(in_x, in_y), in_front(depth, p));
    if (hn::AllFalse(d, inside)) return;
    HWY_ALIGN std::int32_t index[kLanes], nearness[kLanes];
    const Int cell =
        cells_of(grid, hn::IfThenElseZero(inside, p.u), hn::IfThenElseZero(inside, p.v));
    hn::Store(hn::IfThenElse(hn::RebindMask(IntTag(), inside), cell, set(grid.count())), IntTag(),
              index);
    hn::Store(nearness_of(p), IntTag(), nearness);
    for (int i = 0; i < kLanes; ++i) {
        Nearness& at = cells[index[i]];
        at = std::max(at, static_cast<Nearness>(nearness[i]));
    }
}

#if HWY_TARGET != HWY_SCALAR
// How far apart a vector's neighbours are, in cells: [1/2, 1], and 1 where that is not so.
HWY_INLINE float step_of(Float u) {
    const float step = (hn::ExtractLane(u, kLanes - 1) - hn::GetLane(u)) * (1.0f / (kLanes - 1));
    return step >= 0.5f && step < 1 ? step : 1;
}

// From lanes that are `step` cells apart to cells, of which the first lane lies in the first, by
// `part` from its border: each takes the lane next to its middle, those behind the last lane none.
HWY_INLINE Int cell_by_cell(Int near, float step, float part) {
    const FloatTag d;
    const IntTag di;
    const Float border = hn::Sub(hn::Iota(d, 0.0f), hn::Set(d, part));
    const Float last = set(kLanes - 1.0);
    const Float lane = hn::Mul(hn::Add(border, set(0.5)), hn::Set(d, 1.0f / step));
    const Int index = to_integer(hn::Min(hn::Max(lane, hn::Zero(d)), last));
    const Int chosen = hn::TableLookupLanes(near, hn::IndicesFromVec(di, index));
    const Mask reached = hn::Le(border, hn::Mul(last, hn::Set(d, step)));
    return hn::IfThenElseZero(hn::RebindMask(di, reached), chosen);
}

// The same of `count` vectors from pixel `begin` of a row on. Pixels of one surface fall into
// neighbouring cells: all of a vector are written at once, where this moves none by more than half
// a cell. Returns which remain to be done.
template <bool bends>
HWY_INLINE Vectors splat_together(const CellGrid& grid, const AnyRow& row, const DepthRow& depths,
                                  int begin, int count, Nearness* HWY_RESTRICT cells) {
    const FloatTag d;
    const IntTag di;
    const ShortTag shorts;
    HWY_ALIGN Nearness nearness[kVectors][kLanes];
    HWY_ALIGN float u[kVectors] = {}, v[kVectors] = {};
    const Float lane = hn::Iota(d, 0.0f);
    Vectors together = 0;
    Float along = hn::Add(hn::Iota(d, 0.0f), set(double(begin)));
    for (int i = 0; i < count; ++i) {
        const Float depth = depths.load(begin + i * kLanes);
        depths.prefetch_next_row(begin + i * kLanes);
        Points p;
        if constexpr (bends) p = project<false>(row.bent, depth, begin + i * kLanes);
        else p = project<false>(row.straight, depth, along);
        // Where lenses bend, neighbours are often less than a cell apart.
        const float step = bends ? step_of(p.u) : 1;
        const Float start = hn::Sub(p.u, hn::Mul(lane, hn::Set(d, step)));
        u[i] = hn::ExtractLane(start, kLanes / 2);
        v[i] = hn::ExtractLane(p.v, kLanes / 2);
        const Float apart =
            hn::Max(hn::Abs(hn::Sub(start, set(u[i]))), hn::Abs(hn::Sub(p.v, set(v[i]))));
        const Mask fits = hn::And(in_front(depth, p), hn::Lt(apart, set(0.5)));
        together |= Vectors{hn::AllTrue(d, fits)} << i;
        Int near = nearness_of(p);
        if (bends && step < 1) near = cell_by_cell(near, step, u[i] - std::floor(u[i]));
        hn::Store(hn::DemoteTo(shorts, near), shorts, nearness[i]);
        along = hn::Add(along, set(double{kLanes}));
    }
    HWY_ALIGN std::int32_t first[kVectors];
    for (int i = 0; i < kVectors; i += kLanes) {
        const Float x = hn::Load(d, u + i), y = hn::Load(d, v + i), zero = hn::Zero(d);
        const Mask in_x = hn::And(hn::Ge(x, zero), hn::Le(x, set(double(grid.width - kLanes))));
        const Mask in_y = hn::And(hn::Ge(y, zero), hn::Le(y, set(grid.height - 1.0)));
        const Int cell = cells_of(grid, x, y);
        hn::Store(hn::IfThenElse(hn::RebindMask(di, hn::And(in_x, in_y)), cell, set(-1)), di,
                  first + i);
    }
    Vectors left = all_of(count);
    // Neighbours may share a cell: to read what has just been written takes long.
    for (int odd = 0; odd < 2; ++odd) {
        for (int i = odd; i < count; i += 2) {
            if (!((together >> i) & 1) || first[i] < 0) continue;
            left &= ~(Vectors{1} << i);
            Nearness* to = cells + first[i];
            const auto nearest = hn::Max(hn::LoadU(shorts, to), hn::Load(shorts, nearness[i]));
            hn::StoreU(nearest, shorts, to);
        }
    }
    return left;
}
#endif

void splat_rows(const Projector& projector, const DepthRows& depth, DepthRows::Room& room,
                const CellGrid& grid, int begin, int end, Nearness* HWY_RESTRICT cells) {
    const int width = depth.width();
    for (int y = begin; y < end; ++y) {
        const AnyRow row(projector, y, 0, grid.per_pixel_x, grid.per_pixel_y);
        const DepthRow depths(depth, y, room);
        const auto splat_at = [&](int x) HWY_ATTR {
            const Float along = hn::Add(hn::Iota(FloatTag(), 0.0f), set(double(x)));
            const Float z = depths.load(x, width - x);
            splat(grid, z, project<false>(row, z, along, x), cells);
        };
        int x = 0;
#if HWY_TARGET != HWY_SCALAR
        while (width - x >= kLanes) {
            const int count = std::min(kVectors, (width - x) / kLanes);
            Vectors left = row.bends ? splat_together<true>(grid, row, depths, x, count, cells)
                                     : splat_together<false>(grid, row, depths, x, count, cells);
            for (; left; left &= left - 1) splat_at(x + kLanes * first_of(left));
            x += count * kLanes;
        }
#endif
        for (; x < width; x += kLanes) splat_at(x);
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

void splat_rows(const Projector& projector, const DepthRows& depth, DepthRows::Room& room,
                const CellGrid& grid, int begin, int end, Nearness* cells) {
    HWY_DYNAMIC_DISPATCH(splat_rows)(projector, depth, room, grid, begin, end, cells);
}

void join_cells(const CellGrid& grid, const Nearness* parts, int count, int begin, int end,
                Nearness* out) {
    HWY_DYNAMIC_DISPATCH(join_cells)(grid, parts, count, begin, end, out);
}

}  // namespace xcalib
#endif

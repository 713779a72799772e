// A stretch of a row: what is usual is done in loops of a few steps each,
// through memory. A vector's steps wait for each other, and what waits fills
// the processor; in short loops, other vectors' steps come in between. Included
// once for each instruction set.
#if defined(XCALIB_STRETCH_INL_) == defined(HWY_TARGET_TOGGLE)
#ifdef XCALIB_STRETCH_INL_
#undef XCALIB_STRETCH_INL_
#else
#define XCALIB_STRETCH_INL_
#endif

#include "register/fixed-inl.hpp"
#include "register/hidden_row-inl.hpp"
#include "register/sample-inl.hpp"

#if HWY_TARGET != HWY_SCALAR
HWY_BEFORE_NAMESPACE();
namespace xcalib {
namespace HWY_NAMESPACE {
namespace {

// The windows of the vectors. First the place of each vector's first point, as
// a float shifted by kLarge; then its window's first pixel, shifted by
// kLargeBits, and where this lies in memory.
struct Windows {
    HWY_ALIGN float first_x[kVectors] = {}, first_y[kVectors] = {};
    HWY_ALIGN std::int32_t x[kVectors], y[kVectors], offset[kVectors];

    // Places are in 1 / 2^kShift px. Windows begin `before` pixels left of the
    // point, at the least in column 0 and row 0, at the most in `last_x` and
    // `last_y`: within memory, whatever the points are. There are so many units
    // to a column, and to a row.
    template <int kShift>
    HWY_INLINE void place(int before, int last_x, int last_y, int column, int row) {
        const IntTag d;
        const auto within = [](Int value, int last) HWY_ATTR {
            return hn::Min(hn::Max(value, hn::Zero(IntTag())), set(last));
        };
        const auto whole = [](const float *first) HWY_ATTR {
            return hn::ShiftRight<kShift>(to_integer(hn::Load(FloatTag(), first)));
        };
        for (int i = 0; i < kVectors; i += kLanes) {
            const Int shift = set(kLargeBits);
            const Int left = within(hn::Sub(whole(first_x + i), set(before)), last_x);
            const Int top = within(whole(first_y + i), last_y);
            hn::Store(hn::Add(hn::ShiftLeft<kShift>(left), shift), d, x + i);
            hn::Store(hn::Add(hn::ShiftLeft<kShift>(top), shift), d, y + i);
            hn::Store(hn::Add(hn::Mul(top, set(row)), hn::Mul(left, set(column))), d, offset + i);
        }
    }
    HWY_INLINE void start(const RowPoints &points, int count) {
        for (int i = 0; i < count; ++i) {
            first_x[i] = points.u[i * kLanes];
            first_y[i] = points.v[i * kLanes];
        }
    }
};

// Where a point lies along an axis: a whole number, as a float shifted by
// kLarge, of which the bits are one too, and the rest.
struct Whole {
    Float shifted;

    HWY_INLINE explicit Whole(Float place) : shifted(hn::Add(place, set(kLarge))) {}
    HWY_INLINE Int bits() const { return hn::BitCast(IntTag(), shifted); }
    HWY_INLINE Float rest(Float place) const {
        return hn::Add(hn::Sub(place, hn::Sub(shifted, set(kLarge))), set(-kHalfBack));
    }
};

// Where a grid of cells tells what is hidden: the points in cells, as in Cells.
struct CellStretch {
    HWY_ALIGN float x[kVectors * kLanes], y[kVectors * kLanes];
    Windows windows;
};

HWY_INLINE bool none(Int bits) { return hn::AllTrue(IntTag(), hn::Eq(bits, hn::Zero(IntTag()))); }

// Where `count` vectors lie, from pixel `begin` on, and of these points the
// greatest 1/z. Those no farther than `least` lie nowhere, if no lens bends.
// `out` is where they will be written, and is asked for, as the next row's
// depth is, unless it is `later`.
template <bool bends, bool later>
HWY_INLINE Float locate(const AnyRow &row, const DepthRow &depths, float least, int begin,
                        int count, const char *out, int vector_bytes, const RowPoints &points) {
    const FloatTag d;
    const Float nowhere = set(std::numeric_limits<double>::quiet_NaN());
    Float along = hn::Add(hn::Iota(d, 0.0f), set(double(begin)));
    Float nearest = hn::Zero(d);
    for (int i = 0; i < count; ++i) {
        const int x = begin + i * kLanes;
        const Float depth = depths.load(x);
        if constexpr (!later) {
            depths.prefetch_next_row(x);
            __builtin_prefetch(out + (i + kVectors) * vector_bytes,
                               1);  // a stretch ahead
        }
        Points p;
        Mask somewhere;
        if constexpr (bends) {
            p = project<true>(row.bent, depth, x);
            somewhere = in_front(depth, p);
        } else {
            p = project<true>(row.straight, depth, along);
            somewhere = hn::Gt(depth, hn::Set(d, least));
        }
        hn::Store(hn::IfThenElse(somewhere, p.u, nowhere), d, points.u + i * kLanes);
        hn::Store(p.v, d, points.v + i * kLanes);
        hn::Store(p.inverse_z, d, points.inverse_z + i * kLanes);
        nearest = hn::Max(nearest, hn::IfThenElseZero(somewhere, p.inverse_z));
        along = hn::Add(along, set(double{kLanes}));
    }
    return nearest;
}

// By how many rows from `row`, where a vector's first point lies, a window of
// some rows begins: one up if some point lies above, and in `last` at the most.
HWY_INLINE int first_row(int row, bool above, int last) {
    return std::clamp(above ? row - 1 : row, 0, last) - row;
}

// Marks those of a vector that are hidden, all of which were valid.
template <class T, int kChannels>
HWY_INLINE void mark_vector(Mask hidden, bool hide, T *out, std::uint8_t *mask) {
    if (hn::AllFalse(FloatTag(), hidden)) return;
    store_codes(hn::IfThenElseZero(hn::RebindMask(IntTag(), hidden), code_of(Validity::occluded)),
                mask);
    if (!hide) return;
    for (int k = 0; k < kLanes; ++k)
        if (mask[k]) std::fill_n(out + kChannels * k, kChannels, T{0});
}

// Marks what is hidden of vectors of which all points lie within the source.
// Points are in `units` of a pixel.
template <class T, int kChannels>
HWY_INLINE void mark_hidden(const RowsTask &task, Vectors vectors, int count,
                            const RowPoints &points, double units, CellStretch &stretch, T *out,
                            std::uint8_t *mask) {
    const FloatTag d;
    const IntTag di;
    const CellGrid &grid = *task.grid;
    const bool bends = task.projector->bends();
    constexpr int kWindow = 2 * kLanes, kBefore = kWindow / 8;
    const auto pixels = [&](const float *places) HWY_ATTR {
        return hn::Mul(hn::Sub(hn::Load(d, places), set(kHalfBack)), set(1 / units));
    };
    for (int i = 0; i < count * kLanes; i += kLanes) {
        Points p;
        p.u = pixels(points.u + i);
        p.v = pixels(points.v + i);
        const Cells cells(grid, p);
        hn::Store(hn::Sub(cells.x, set(kLarge)), d, stretch.x + i);
        hn::Store(hn::Sub(cells.y, set(kLarge)), d, stretch.y + i);
    }
    stretch.windows.start({stretch.x, stretch.y, nullptr}, count);
    Windows &windows = stretch.windows;
    windows.place<0>(kBefore, std::max(0, grid.width - kBefore), grid.height - 1, 1, grid.width);
    for (int i = 0; i < count; ++i) {
        const Float at_x = Whole(hn::Load(d, stretch.x + i * kLanes)).shifted;
        const Float at_y = Whole(hn::Load(d, stretch.y + i * kLanes)).shifted;
        const Int index = hn::Sub(hn::BitCast(di, at_x), set(windows.x[i]));
        const Int below = hn::Sub(hn::BitCast(di, at_y), set(windows.y[i]));
        const Nearness *from = task.cells + windows.offset[i];
        Float nearest_there = hn::BitCast(d, nearest_in_window(from, grid.step(), index));
        if (!none(hn::Or(below, hn::AndNot(set(kWindow - 1), index)))) {
            if (!((vectors >> i) & 1)) continue;
            // Where a lens bends rows, points often come into the next one.
            const int moved =
                first_row(windows.y[i] - kLargeBits, !hn::AllFalse(di, hn::Lt(below, hn::Zero(di))),
                          grid.height - 2);
            const Int row = hn::Sub(below, set(moved));
            if (bends && none(hn::Or(hn::AndNot(set(1), row), hn::AndNot(set(kWindow - 1), index))))
                nearest_there = hn::BitCast(
                    d, hn::IfThenElse(
                           hn::Ne(row, hn::Zero(di)),
                           nearest_in_window(from + (moved + 1) * grid.width, grid.step(), index),
                           nearest_in_window(from + moved * grid.width, grid.step(), index)));
            else nearest_there = nearest_in(grid, task.cells, at_x, at_y);
        }
        const Float inverse_z = hn::Load(d, points.inverse_z + i * kLanes);
        mark_vector<T, kChannels>(is_behind(grid, nearest_there, inverse_z), task.hide,
                                  out + i * kLanes * kChannels, mask + i * kLanes);
    }
}

// Samples the vectors of which all points lie between the same two rows of the
// source, and within a window of them. Returns which do not; of these nothing
// that is written counts, so that nothing waits for a branch. The source must
// be wider than the window.
template <class T, Reach reach>
HWY_INLINE Vectors sample_windows(const Source &source, int count, const RowPoints &points,
                                  Windows &windows, T *out) {
    const FloatTag d;
    constexpr int kWindow = window<T, reach>();
    windows.place<0>(kBefore<T, reach>, source.width - 1 - kWindow, source.height - 2, sizeof(T),
                     static_cast<int>(source.row_bytes));
    Vectors others = 0;
    for (int i = 0; i < count; ++i) {
        const Float u = hn::Load(d, points.u + i * kLanes), v = hn::Load(d, points.v + i * kLanes);
        const Whole x(u), y(v);
        const Int index = hn::Sub(x.bits(), set(windows.x[i]));
        const Int apart =
            hn::Or(hn::Xor(y.bits(), set(windows.y[i])), beyond_window<T, reach>(index));
        others |= Vectors{!none(apart)} << i;
        store(
            interpolate_in_window<T, reach>(source, windows.offset[i], index, x.rest(u), y.rest(v)),
            out + i * kLanes);
    }
    return others;
}

// The same of some of the vectors, in three rows of the source: where a lens
// bends rows, their points often come into the next one.
template <class T, Reach reach>
HWY_INLINE Vectors sample_windows_bent(const Source &source, Vectors vectors,
                                       const RowPoints &points, const Windows &windows, T *out) {
    if (source.height < 3) return vectors;
    const FloatTag d;
    const IntTag di;
    Vectors others = 0;
    for (; vectors; vectors &= vectors - 1) {
        const int i = first_of(vectors);
        const Float u = hn::Load(d, points.u + i * kLanes), v = hn::Load(d, points.v + i * kLanes);
        const Whole at_x(u), at_y(v);
        const Int y = hn::Sub(at_y.bits(), set(windows.y[i]));
        const int moved = first_row(windows.y[i] - kLargeBits,
                                    !hn::AllFalse(di, hn::Lt(y, hn::Zero(di))), source.height - 3);
        const Int index = hn::Sub(at_x.bits(), set(windows.x[i])), row = hn::Sub(y, set(moved));
        const Int apart = hn::Or(hn::AndNot(set(1), row), beyond_window<T, reach>(index));
        others |= Vectors{!none(apart)} << i;
        const int offset = windows.offset[i] + moved * static_cast<int>(source.row_bytes);
        store(interpolate_in_three<T, reach>(source, offset, index,
                                             hn::RebindMask(d, hn::Ne(row, hn::Zero(di))),
                                             at_x.rest(u), at_y.rest(v)),
              out + i * kLanes);
    }
    return others;
}

// The same of some of the vectors, wherever within the source their points lie:
// at depth edges, where the points come into the next row, of a source too fine
// for windows, and of colours.
template <class T, int kChannels, bool fixed>
HWY_INLINE Vectors gather(const Source &source, Vectors vectors, const RowPoints &points, T *out) {
    const FloatTag d;
    const IntTag di;
    const hn::RebindToUnsigned<IntTag> du;
    const auto within = [&](Int value,
                            int size) HWY_ATTR {  // those below 0 are large
        const auto last = hn::Set(du, static_cast<std::uint32_t>(size - 2));
        return hn::BitCast(di, hn::Min(hn::BitCast(du, value), last));
    };
    const auto part = [&](Int value) HWY_ATTR {
        const Float units = hn::ConvertTo(d, hn::And(value, set((1 << kFixedBits) - 1)));
        return hn::Mul(units, set(1 / (kFixedUnit - 1)));
    };
    Vectors others = 0;
    for (; vectors; vectors &= vectors - 1) {
        const int i = first_of(vectors);
        const Float u = hn::Load(d, points.u + i * kLanes), v = hn::Load(d, points.v + i * kLanes);
        const Whole at_x(u), at_y(v);
        Int x = hn::Sub(at_x.bits(), set(kLargeBits)), y = hn::Sub(at_y.bits(), set(kLargeBits));
        Float a, b;
        if constexpr (fixed) {
            a = part(x);
            b = part(y);
            x = hn::ShiftRight<kFixedBits>(x);
            y = hn::ShiftRight<kFixedBits>(y);
        } else {
            a = at_x.rest(u);
            b = at_y.rest(v);
        }
        const Int left = within(x, source.width), top = within(y, source.height);
        const Int beyond = hn::Or(hn::Xor(x, left), hn::Xor(y, top));
        others |= Vectors{!none(beyond)} << i;
        if (hn::AllFalse(di, hn::Eq(beyond, hn::Zero(di)))) continue;  // nothing to look up
        Float values[kChannels];
        interpolate_anywhere<T>(source, left, top, a, b, values);
        store_pixels(values, out + i * kLanes * kChannels);
    }
    return others;
}

#if XCALIB_FIXED
// The same of bytes, located in fixed numbers.
template <int kChannels>
HWY_INLINE Vectors sample_fixed(const Source &source, int count, const RowPoints &points,
                                Windows &windows, std::uint8_t *out) {
    const FloatTag d;
    // Of colours, a byte more is read than the window's pixels have.
    constexpr int kWidth = (kFixedWindow + kChannels - 1) / kChannels;
    windows.place<kFixedBits>(kFixedBefore<kChannels>, source.width - kWidth, source.height - 2,
                              kChannels, static_cast<int>(source.row_bytes));
    Vectors others = 0;
    for (int i = 0; i < count; ++i) {
        const Whole u(hn::Load(d, points.u + i * kLanes)), v(hn::Load(d, points.v + i * kLanes));
        const Int x = hn::Sub(u.bits(), set(windows.x[i]));
        const Int y = hn::Sub(v.bits(), set(windows.y[i]));
        const bool inside = interpolate_fixed<1, kChannels>(source, windows.offset[i], x, y,
                                                            out + i * kLanes * kChannels);
        others |= Vectors{!inside} << i;
    }
    return others;
}

// As sample_windows_bent.
template <int kChannels>
HWY_INLINE Vectors sample_fixed_bent(const Source &source, Vectors vectors, const RowPoints &points,
                                     const Windows &windows, std::uint8_t *out) {
    if (source.height < 3) return vectors;
    const FloatTag d;
    const IntTag di;
    Vectors others = 0;
    for (; vectors; vectors &= vectors - 1) {
        const int i = first_of(vectors);
        const Whole u(hn::Load(d, points.u + i * kLanes)), v(hn::Load(d, points.v + i * kLanes));
        const Int x = hn::Sub(u.bits(), set(windows.x[i]));
        const Int y = hn::Sub(v.bits(), set(windows.y[i]));
        const int moved = first_row((windows.y[i] - kLargeBits) >> kFixedBits,
                                    !hn::AllFalse(di, hn::Lt(y, hn::Zero(di))), source.height - 3);
        const bool inside = interpolate_fixed<2, kChannels>(
            source, windows.offset[i] + moved * static_cast<int>(source.row_bytes), x,
            hn::Sub(y, set(moved * (1 << kFixedBits))), out + i * kLanes * kChannels);
        others |= Vectors{!inside} << i;
    }
    return others;
}
#endif

template <class T, Reach reach>
HWY_INLINE Vectors sample_in(const Source &source, int count, bool bends, const RowPoints &points,
                             Windows &windows, T *out) {
    const Vectors others = sample_windows<T, reach>(source, count, points, windows, out);
    return bends ? sample_windows_bent<T, reach>(source, others, points, windows, out) : others;
}

// A row of the reference, on its way into the source.
template <class T, int kChannels>
struct UsualRow {
    const RowsTask &task;
    const Source &source;
    const DepthRow &depths;
    T *out;
    std::uint8_t *mask;
    Reach reach;
    bool fixed = false;  // are the points in whole numbers of kFixedUnit?
    AnyRow row;
    float least_depth;

    HWY_INLINE UsualRow(const RowsTask &of, const Source &from, const DepthRow &depth, int y, T *to,
                        std::uint8_t *codes)
        : task(of), source(from), depths(depth), out(to), mask(codes),
          reach(reach_of<T>(from, of.projector->step_along_row(of.depth->width() / 2, y))),
          fixed(takes_fixed(from, reach)),
          row(*of.projector, y, kHalfBack / units(), units(), units()),
          least_depth(row.bends ? 0.0f : of.projector->least_depth(y, of.depth->width())) {}

    HWY_INLINE double units() const { return fixed ? kFixedUnit : 1.0; }  // of a pixel

    // Vectors, `count` from pixel `begin` on, of whose points the greatest 1/z is
    // returned.
    template <bool later>
    HWY_INLINE Float locate(int begin, int count, const RowPoints &points) const {
        const auto *to = reinterpret_cast<const char *>(out + begin * kChannels);
        constexpr int kBytes = int{sizeof(T)} * kLanes * kChannels;
        return row.bends ? HWY_NAMESPACE::locate<true, later>(row, depths, least_depth, begin,
                                                              count, to, kBytes, points)
                         : HWY_NAMESPACE::locate<false, later>(row, depths, least_depth, begin,
                                                               count, to, kBytes, points);
    }
    // The same vectors, located, of a mask that is 0. Returns those of which some
    // points lie outside the source, or nowhere.
    HWY_INLINE Vectors sample(int begin, int count, const RowPoints &points) const;

   private:
    static HWY_INLINE bool takes_fixed(const Source &source, Reach reach) {
#if XCALIB_FIXED
        return sizeof(T) == 1 && fits_fixed<kChannels>(source, reach);
#else
        (void)source, (void)reach;
        return false;
#endif
    }
};

template <class T, int kChannels>
HWY_INLINE Vectors UsualRow<T, kChannels>::sample(int begin, int count,
                                                  const RowPoints &points) const {
    T *to = out + begin * kChannels;
    Windows windows;
    windows.start(points, count);
#if XCALIB_FIXED
    if constexpr (sizeof(T) == 1) {
        if (fixed) {
            Vectors others = sample_fixed<kChannels>(source, count, points, windows, to);
            if (row.bends)
                others = sample_fixed_bent<kChannels>(source, others, points, windows, to);
            return gather<T, kChannels, true>(source, others, points, to);
        }
    }
#endif
    Vectors others = all_of(count);
    if constexpr (kChannels == 1) {
        if (reach == Reach::one)
            others = sample_in<T, Reach::one>(source, count, row.bends, points, windows, to);
        else if (reach == Reach::two)
            others = sample_in<T, Reach::two>(source, count, row.bends, points, windows, to);
    }
    return gather<T, kChannels, false>(source, others, points, to);
}

// The whole vectors of a row, of which one(x) does those that are not usual.
// `nearest` is the greatest 1/z of the pixels behind them, which have been put.
template <class T, int kChannels, class One>
HWY_INLINE void register_usual(const UsualRow<T, kChannels> &row, int whole, HiddenRow &hidden,
                               Float nearest, const One &one) {
    const RowsTask &task = row.task;
    constexpr int kStretch = kVectors * kLanes;  // pixels
    const auto vectors_from = [&](int x) { return std::min(kVectors, (whole - x) / kLanes); };
    const auto finish = [&](int x, Vectors others) HWY_ATTR {
        for (; others; others &= others - 1) one(x + kLanes * first_of(others));
    };
    std::fill_n(row.mask, whole, std::uint8_t{0});
    if (!task.row_grid) {
        HWY_ALIGN float u[kStretch], v[kStretch], inverse_z[kStretch];
        const RowPoints points{u, v, inverse_z};
        CellStretch cells;
        for (int x = 0; x < whole; x += kStretch) {
            const int n = vectors_from(x);
            row.template locate<false>(x, n, points);
            const Vectors others = row.sample(x, n, points);
            if (task.cells)
                mark_hidden<T, kChannels>(task, all_of(n) & ~others, n, points, row.units(), cells,
                                          row.out + x * kChannels, row.mask + x);
            finish(x, others);
        }
        return;
    }
    const RowPoints points = hidden.points();
    for (int x = 0; x < whole; x += kStretch)
        nearest = hn::Max(nearest, row.template locate<true>(x, vectors_from(x), points.from(x)));
    const bool any = hidden.find(greatest(nearest));
    for (int x = 0; x < whole; x += kStretch) {
        const int n = vectors_from(x);
        // In these loops memory has less to do than where the row was located.
        for (int i = 0; i < n; ++i) row.depths.prefetch_next_row(x + i * kLanes);
        const Vectors others = row.sample(x, n, points.from(x));
        Vectors maybe = any ? hidden.may_be_hidden(x / kLanes) & all_of(n) & ~others : 0;
        for (; maybe; maybe &= maybe - 1) {
            const int at = x + kLanes * first_of(maybe);
            mark_vector<T, kChannels>(hidden.hidden(at), task.hide, row.out + at * kChannels,
                                      row.mask + at);
        }
        finish(x, others);
    }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace xcalib
HWY_AFTER_NAMESPACE();
#endif

#endif

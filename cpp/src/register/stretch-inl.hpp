// A stretch of a row: what is usual is done in loops of a few steps each, through memory. A
// vector's steps wait for each other, and what waits fills the processor; in short loops, other
// vectors' steps come in between. Included once for each instruction set.
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

struct UsualVector {
    HWY_ALIGN float x[kLanes], y[kLanes], a[kLanes], b[kLanes];  // as in Located
};
struct UsualCells {
    HWY_ALIGN float x[kLanes], y[kLanes], inverse_z[kLanes];  // as in Cells
};

// The windows of the vectors. First the place of each vector's first point, as a float shifted by
// kLarge; then its window's first pixel, shifted by kLargeBits, and where this lies in memory.
struct Windows {
    HWY_ALIGN std::int32_t x[kVectors] = {}, y[kVectors] = {}, offset[kVectors] = {};

    HWY_INLINE void start(int i, Float first_x, Float first_y) {
        const float at[] = {hn::GetLane(first_x), hn::GetLane(first_y)};
        std::memcpy(x + i, at, sizeof(float));
        std::memcpy(y + i, at + 1, sizeof(float));
    }

    // Places are in 1 / 2^kShift px. Windows begin `before` pixels left of the point, at the least
    // in column 0 and row 0, at the most in `last_x` and `last_y`: within memory, whatever the
    // points are. There are so many units to a column, and to a row.
    template <int kShift>
    HWY_INLINE void place(int before, int last_x, int last_y, int column, int row) {
        const IntTag d;
        const auto within = [](Int value, int last) HWY_ATTR {
            return hn::Min(hn::Max(value, hn::Zero(IntTag())), set(last));
        };
        for (int i = 0; i < kVectors; i += kLanes) {
            const Int shift = set(kLargeBits);
            const Int first_x = hn::ShiftRight<kShift>(hn::Sub(hn::Load(d, x + i), shift));
            const Int first_y = hn::ShiftRight<kShift>(hn::Sub(hn::Load(d, y + i), shift));
            const Int left = within(hn::Sub(first_x, set(before)), last_x);
            const Int top = within(first_y, last_y);
            hn::Store(hn::Add(hn::ShiftLeft<kShift>(left), shift), d, x + i);
            hn::Store(hn::Add(hn::ShiftLeft<kShift>(top), shift), d, y + i);
            hn::Store(hn::Add(hn::Mul(top, set(row)), hn::Mul(left, set(column))), d, offset + i);
        }
    }
};

struct Stretch {
    UsualVector vectors[kVectors];
    Windows source;
};
// Beside it, where a grid of cells tells what is hidden.
struct CellStretch {
    UsualCells vectors[kVectors];
    Windows cells;
};
// What is to be told of what is hidden: nothing, by a grid of cells, or by a row of them.
enum class Hiding { none, grid, row };

// Where that is noted down.
struct HidingRoom {
    CellStretch* cells;
    HiddenRow* row;
};

HWY_INLINE bool none(Int bits) { return hn::AllTrue(IntTag(), hn::Eq(bits, hn::Zero(IntTag()))); }

// Where `count` vectors lie, from pixel `begin` of row y on. `out` is where they will be written.
template <bool fixed, Hiding hiding, bool bends>
HWY_INLINE void locate(const RowsTask& task, const AnyRow& row, const DepthRow& depths, int y,
                       int begin, int count, const char* out, int vector_bytes, Stretch& stretch,
                       const HidingRoom& room) {
    const FloatTag d;
    const Float least =
        hn::Set(d, bends ? 0.0f : task.projector->least_depth(y, task.depth->width()));
    Float along = hn::Add(hn::Iota(d, 0.0f), set(double(begin)));
    for (int i = 0; i < count; ++i) {
        UsualVector& vector = stretch.vectors[i];
        const int x = begin + i * kLanes;
        const Float depth = depths.load(x);
        depths.prefetch_next_row(x);
        __builtin_prefetch(out + (i + kVectors) * vector_bytes, 1);  // a stretch ahead
        Located at;
        Mask somewhere;
        if constexpr (bends) {
            at = locate(row.bent, depth, x);
            somewhere = in_front(depth, at.points());
        } else {
            at = locate(row.straight, depth, along);
            somewhere = hn::Gt(depth, least);
        }
        // Elsewhere it is far outside.
        const Float left = hn::IfThenElseZero(somewhere, at.x);
        hn::Store(left, d, vector.x);
        hn::Store(at.y, d, vector.y);
        stretch.source.start(i, left, at.y);
        if constexpr (!fixed) {
            hn::Store(at.a, d, vector.a);
            hn::Store(at.b, d, vector.b);
        }
        Points points = at.points();
        if constexpr (fixed) {
            points.u = hn::Mul(points.u, set(1 / kFixedUnit));
            points.v = hn::Mul(points.v, set(1 / kFixedUnit));
        }
        if constexpr (hiding == Hiding::grid) {
            const Cells cells(*task.grid, points);
            UsualCells& of_vector = room.cells->vectors[i];
            hn::Store(cells.x, d, of_vector.x);
            hn::Store(cells.y, d, of_vector.y);
            hn::Store(at.inverse_z, d, of_vector.inverse_z);
            room.cells->cells.start(i, cells.x, cells.y);
        }
        if constexpr (hiding == Hiding::row) room.row->put(x, points, somewhere, along);
        along = hn::Add(along, set(double{kLanes}));
    }
}

// By how many rows from `row`, where a vector's first point lies, a window of some rows begins: one
// up if some point lies above, and in `last` at the most.
HWY_INLINE int first_row(int row, bool above, int last) {
    return std::clamp(above ? row - 1 : row, 0, last) - row;
}

// Marks those of a vector that are hidden, all of which were valid.
template <class T, int kChannels>
HWY_INLINE void mark_vector(Mask hidden, bool hide, T* out, std::uint8_t* mask) {
    if (hn::AllFalse(FloatTag(), hidden)) return;
    store_codes(hn::IfThenElseZero(hn::RebindMask(IntTag(), hidden), code_of(Validity::occluded)),
                mask);
    if (!hide) return;
    for (int k = 0; k < kLanes; ++k)
        if (mask[k]) std::fill_n(out + kChannels * k, kChannels, T{0});
}

// Marks what is hidden of vectors of which all points lie within the source.
template <class T, int kChannels>
HWY_INLINE void mark_hidden(const RowsTask& task, Vectors vectors, int count, CellStretch& stretch,
                            T* out, std::uint8_t* mask) {
    const FloatTag d;
    const IntTag di;
    const CellGrid& grid = *task.grid;
    const bool bends = task.projector->bends();
    constexpr int kWindow = 2 * kLanes, kBefore = kWindow / 8;
    stretch.cells.place<0>(kBefore, std::max(0, grid.width - kBefore), grid.height - 1, 1,
                           grid.width);
    for (int i = 0; i < count; ++i) {
        const UsualCells& vector = stretch.vectors[i];
        const Int x = hn::BitCast(di, hn::Load(d, vector.x));
        const Int y = hn::BitCast(di, hn::Load(d, vector.y));
        const Int index = hn::Sub(x, set(stretch.cells.x[i]));
        const Int apart =
            hn::Or(hn::Xor(y, set(stretch.cells.y[i])), hn::AndNot(set(kWindow - 1), index));
        const Nearness* from = task.cells + stretch.cells.offset[i];
        Float nearest_there = hn::BitCast(d, nearest_in_window(from, grid.step(), index));
        if (!none(apart)) {
            if (!((vectors >> i) & 1)) continue;
            // Where a lens bends rows, points often come into the next one.
            const Int below = hn::Sub(y, set(stretch.cells.y[i]));
            const int moved =
                first_row(stretch.cells.y[i] - kLargeBits,
                          !hn::AllFalse(di, hn::Lt(below, hn::Zero(di))), grid.height - 2);
            const Int row = hn::Sub(below, set(moved));
            if (bends && none(hn::Or(hn::AndNot(set(1), row), hn::AndNot(set(kWindow - 1), index))))
                nearest_there = hn::BitCast(
                    d, hn::IfThenElse(
                           hn::Ne(row, hn::Zero(di)),
                           nearest_in_window(from + (moved + 1) * grid.width, grid.step(), index),
                           nearest_in_window(from + moved * grid.width, grid.step(), index)));
            else nearest_there = nearest_in(grid, task.cells, hn::BitCast(d, x), hn::BitCast(d, y));
        }
        mark_vector<T, kChannels>(is_behind(grid, nearest_there, hn::Load(d, vector.inverse_z)),
                                  task.hide, out + i * kLanes * kChannels, mask + i * kLanes);
    }
}

// Samples the vectors of which all points lie between the same two rows of the source, and within a
// window of them. Returns which do not; of these nothing that is written counts, so that nothing
// waits for a branch. The source must be wider than the window.
template <class T, Reach reach>
HWY_INLINE Vectors sample_windows(const Source& source, int count, Stretch& stretch, T* out,
                                  std::uint8_t* mask) {
    const FloatTag d;
    const IntTag di;
    constexpr int kWindow = window<T, reach>();
    Windows& windows = stretch.source;
    windows.place<0>(kBefore<T, reach>, source.width - 1 - kWindow, source.height - 2, sizeof(T),
                     static_cast<int>(source.row_bytes));
    Vectors others = 0;
    for (int i = 0; i < count; ++i) {
        const UsualVector& vector = stretch.vectors[i];
        const Int x = hn::BitCast(di, hn::Load(d, vector.x));
        const Int y = hn::BitCast(di, hn::Load(d, vector.y));
        const Int index = hn::Sub(x, set(windows.x[i]));
        const Int apart =
            hn::Or(hn::Xor(y, set(windows.y[i])), hn::AndNot(set(kWindow - 1), index));
        others |= Vectors{!none(apart)} << i;
        store(interpolate_in_window<T, reach>(source, windows.offset[i], index,
                                              hn::Load(d, vector.a), hn::Load(d, vector.b)),
              out + i * kLanes);
        hn::StoreU(hn::Zero(ByteTag()), ByteTag(), mask + i * kLanes);
    }
    return others;
}

// The same of some of the vectors, in three rows of the source: where a lens bends rows, their
// points often come into the next one.
template <class T, Reach reach>
HWY_INLINE Vectors sample_windows_bent(const Source& source, Vectors vectors,
                                       const Stretch& stretch, T* out, std::uint8_t* mask) {
    if (source.height < 3) return vectors;
    const FloatTag d;
    const IntTag di;
    constexpr int kWindow = window<T, reach>();
    const Windows& windows = stretch.source;
    Vectors others = 0;
    for (; vectors; vectors &= vectors - 1) {
        const int i = first_of(vectors);
        const UsualVector& vector = stretch.vectors[i];
        const Int x = hn::BitCast(di, hn::Load(d, vector.x));
        const Int y = hn::Sub(hn::BitCast(di, hn::Load(d, vector.y)), set(windows.y[i]));
        const int moved = first_row(windows.y[i] - kLargeBits,
                                    !hn::AllFalse(di, hn::Lt(y, hn::Zero(di))), source.height - 3);
        const Int index = hn::Sub(x, set(windows.x[i])), row = hn::Sub(y, set(moved));
        const Int apart = hn::Or(hn::AndNot(set(1), row), hn::AndNot(set(kWindow - 1), index));
        others |= Vectors{!none(apart)} << i;
        const int offset = windows.offset[i] + moved * static_cast<int>(source.row_bytes);
        store(interpolate_in_three<T, reach>(source, offset, index,
                                             hn::RebindMask(d, hn::Ne(row, hn::Zero(di))),
                                             hn::Load(d, vector.a), hn::Load(d, vector.b)),
              out + i * kLanes);
        hn::StoreU(hn::Zero(ByteTag()), ByteTag(), mask + i * kLanes);
    }
    return others;
}

// The same of some of the vectors, wherever within the source their points lie: at depth edges,
// where the points come into the next row, of a source too fine for windows, and of colours.
template <class T, int kChannels, bool fixed>
HWY_INLINE Vectors gather(const Source& source, Vectors vectors, const Stretch& stretch, T* out,
                          std::uint8_t* mask) {
    const FloatTag d;
    const IntTag di;
    const hn::RebindToUnsigned<IntTag> du;
    const auto number = [&](const float* shifted) HWY_ATTR {
        return hn::Sub(hn::BitCast(di, hn::Load(d, shifted)), set(kLargeBits));
    };
    const auto within = [&](Int value, int size) HWY_ATTR {  // those below 0 are large
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
        const UsualVector& vector = stretch.vectors[i];
        Int x = number(vector.x), y = number(vector.y);
        Float a, b;
        if constexpr (fixed) {
            a = part(x);
            b = part(y);
            x = hn::ShiftRight<kFixedBits>(x);
            y = hn::ShiftRight<kFixedBits>(y);
        } else {
            a = hn::Load(d, vector.a);
            b = hn::Load(d, vector.b);
        }
        const Int left = within(x, source.width), top = within(y, source.height);
        const Int beyond = hn::Or(hn::Xor(x, left), hn::Xor(y, top));
        others |= Vectors{!none(beyond)} << i;
        if (hn::AllFalse(di, hn::Eq(beyond, hn::Zero(di)))) continue;  // nothing to look up
        Float values[kChannels];
        interpolate_anywhere<T>(source, left, top, a, b, values);
        store_pixels(values, out + i * kLanes * kChannels);
        hn::StoreU(hn::Zero(ByteTag()), ByteTag(), mask + i * kLanes);
    }
    return others;
}

#if XCALIB_FIXED
// The same of bytes, located in fixed numbers.
HWY_INLINE Vectors sample_fixed(const Source& source, int count, Stretch& stretch,
                                std::uint8_t* out, std::uint8_t* mask) {
    const FloatTag d;
    const IntTag di;
    Windows& windows = stretch.source;
    windows.place<kFixedBits>(kFixedWindow / 8, source.width - kFixedWindow, source.height - 2, 1,
                              static_cast<int>(source.row_bytes));
    Vectors others = 0;
    for (int i = 0; i < count; ++i) {
        const UsualVector& vector = stretch.vectors[i];
        const Int x = hn::Sub(hn::BitCast(di, hn::Load(d, vector.x)), set(windows.x[i]));
        const Int y = hn::Sub(hn::BitCast(di, hn::Load(d, vector.y)), set(windows.y[i]));
        const bool inside = interpolate_fixed<1>(source, windows.offset[i], x, y, out + i * kLanes);
        others |= Vectors{!inside} << i;
        hn::StoreU(hn::Zero(ByteTag()), ByteTag(), mask + i * kLanes);
    }
    return others;
}

// As sample_windows_bent.
HWY_INLINE Vectors sample_fixed_bent(const Source& source, Vectors vectors, const Stretch& stretch,
                                     std::uint8_t* out, std::uint8_t* mask) {
    if (source.height < 3) return vectors;
    const FloatTag d;
    const IntTag di;
    const Windows& windows = stretch.source;
    Vectors others = 0;
    for (; vectors; vectors &= vectors - 1) {
        const int i = first_of(vectors);
        const UsualVector& vector = stretch.vectors[i];
        const Int x = hn::Sub(hn::BitCast(di, hn::Load(d, vector.x)), set(windows.x[i]));
        const Int y = hn::Sub(hn::BitCast(di, hn::Load(d, vector.y)), set(windows.y[i]));
        const int moved = first_row((windows.y[i] - kLargeBits) >> kFixedBits,
                                    !hn::AllFalse(di, hn::Lt(y, hn::Zero(di))), source.height - 3);
        const bool inside = interpolate_fixed<2>(
            source, windows.offset[i] + moved * static_cast<int>(source.row_bytes), x,
            hn::Sub(y, set(moved * (1 << kFixedBits))), out + i * kLanes);
        others |= Vectors{!inside} << i;
        hn::StoreU(hn::Zero(ByteTag()), ByteTag(), mask + i * kLanes);
    }
    return others;
}
#endif

// A row for each way to locate.
struct RowPair {
    AnyRow exact, fixed;

    HWY_INLINE RowPair(const Projector& projector, int y)
        : exact(projector, y, kHalfBack), fixed(projector, y, kFixedShift, kFixedUnit, kFixedUnit) {
    }
};

template <bool fixed, Hiding hiding>
HWY_INLINE void locate_any(const RowsTask& task, const AnyRow& row, const DepthRow& depths, int y,
                           int begin, int count, const char* out, int vector_bytes,
                           Stretch& stretch, const HidingRoom& room) {
    if (row.bends)
        locate<fixed, hiding, true>(task, row, depths, y, begin, count, out, vector_bytes, stretch,
                                    room);
    else
        locate<fixed, hiding, false>(task, row, depths, y, begin, count, out, vector_bytes, stretch,
                                     room);
}

// A row of the reference, on its way into the source.
template <class T, int kChannels>
struct UsualRow {
    const RowsTask& task;
    const Source& source;
    const DepthRow& depths;
    int y;
    T* out;
    std::uint8_t* mask;
    Reach reach;
    RowPair rows;
    bool fixed = false;

    HWY_INLINE UsualRow(const RowsTask& of, const Source& from, const DepthRow& depth, int at,
                        T* to, std::uint8_t* codes)
        : task(of), source(from), depths(depth), y(at), out(to), mask(codes),
          reach(reach_of<T>(from, of.projector->step_along_row(of.depth->width() / 2, at))),
          rows(*of.projector, at) {
#if XCALIB_FIXED
        fixed = sizeof(T) == 1 && kChannels == 1 && fits_fixed(source, reach);
#endif
    }

    // Vectors, `count` from pixel `begin` on.
    template <Hiding hiding>
    HWY_INLINE void locate(int begin, int count, Stretch& stretch, const HidingRoom& room) const {
        const auto* to = reinterpret_cast<const char*>(out + begin * kChannels);
        constexpr int kBytes = int{sizeof(T)} * kLanes * kChannels;
#if XCALIB_FIXED
        if constexpr (sizeof(T) == 1 && kChannels == 1)
            if (fixed)
                return locate_any<true, hiding>(task, rows.fixed, depths, y, begin, count, to,
                                                kBytes, stretch, room);
#endif
        locate_any<false, hiding>(task, rows.exact, depths, y, begin, count, to, kBytes, stretch,
                                  room);
    }
    HWY_INLINE Vectors sample(int begin, int count, Stretch& stretch) const;
};

template <class T, Reach reach>
HWY_INLINE Vectors sample_in(const Source& source, int count, bool bends, Stretch& stretch, T* out,
                             std::uint8_t* mask) {
    const Vectors others = sample_windows<T, reach>(source, count, stretch, out, mask);
    return bends ? sample_windows_bent<T, reach>(source, others, stretch, out, mask) : others;
}

// The same vectors, located. Returns those of which some points lie outside the source, or nowhere.
template <class T, int kChannels>
HWY_INLINE Vectors UsualRow<T, kChannels>::sample(int begin, int count, Stretch& stretch) const {
    T* to = out + begin * kChannels;
    std::uint8_t* codes = mask + begin;
    Vectors others = all_of(count);
#if XCALIB_FIXED
    if constexpr (sizeof(T) == 1 && kChannels == 1) {
        if (fixed) {
            others = sample_fixed(source, count, stretch, to, codes);
            if (rows.fixed.bends) others = sample_fixed_bent(source, others, stretch, to, codes);
            return gather<T, 1, true>(source, others, stretch, to, codes);
        }
    }
#endif
    if constexpr (kChannels == 1) {
        const bool bends = rows.exact.bends;
        if (reach == Reach::one)
            others = sample_in<T, Reach::one>(source, count, bends, stretch, to, codes);
        else if (reach == Reach::two)
            others = sample_in<T, Reach::two>(source, count, bends, stretch, to, codes);
    }
    return gather<T, kChannels, false>(source, others, stretch, to, codes);
}

// The whole vectors of a row, of which one(x) does those that are not usual.
template <class T, int kChannels, class One>
HWY_INLINE void register_usual(const UsualRow<T, kChannels>& row, int whole, HiddenRow& hidden,
                               const One& one) {
    const RowsTask& task = row.task;
    const int vectors = whole / kLanes;
    const auto finish = [&](int begin, Vectors others) HWY_ATTR {
        for (; others; others &= others - 1) one(begin + kLanes * first_of(others));
    };
    if (!task.row_grid) {
        Stretch stretch;
        CellStretch cells;
        for (int i = 0; i < vectors; i += kVectors) {
            const int begin = i * kLanes, n = std::min(kVectors, vectors - i);
            if (task.cells) row.template locate<Hiding::grid>(begin, n, stretch, {&cells, nullptr});
            else row.template locate<Hiding::none>(begin, n, stretch, {nullptr, nullptr});
            const Vectors others = row.sample(begin, n, stretch);
            if (task.cells)
                mark_hidden<T, kChannels>(task, all_of(n) & ~others, n, cells,
                                          row.out + begin * kChannels, row.mask + begin);
            finish(begin, others);
        }
        return;
    }
    auto* stretches = reinterpret_cast<Stretch*>(task.hidden->stretches.data());
    for (int i = 0; i < vectors; i += kVectors)
        row.template locate<Hiding::row>(i * kLanes, std::min(kVectors, vectors - i),
                                         stretches[i / kVectors], {nullptr, &hidden});
    const bool any = hidden.find();
    for (int i = 0; i < vectors; i += kVectors) {
        const int begin = i * kLanes, n = std::min(kVectors, vectors - i);
        const Vectors others = row.sample(begin, n, stretches[i / kVectors]);
        for (int k = 0; any && k < n; ++k) {
            const int x = begin + k * kLanes;
            if (hidden.may_be_hidden(x) && !((others >> k) & 1))
                mark_vector<T, kChannels>(hidden.hidden(x), task.hide, row.out + x * kChannels,
                                          row.mask + x);
        }
        finish(begin, others);
    }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace xcalib
HWY_AFTER_NAMESPACE();
#endif

#endif

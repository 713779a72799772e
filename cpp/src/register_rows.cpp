#include "register_rows.hpp"

#include <algorithm>
#include <cstring>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "register_rows.cpp"
// Vectors whose size is not known to the compiler cannot stand in a struct.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace xcalib {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
using FloatTag = hn::ScalableTag<float>;
using IntTag = hn::RebindToSigned<FloatTag>;
using ByteTag = hn::Rebind<std::uint8_t, FloatTag>;
using ShortTag = hn::Rebind<std::uint16_t, FloatTag>;
using Float = hn::Vec<FloatTag>;
using Int = hn::Vec<IntTag>;
using Mask = hn::Mask<FloatTag>;
constexpr int kLanes = static_cast<int>(hn::MaxLanes(FloatTag()));

HWY_INLINE Float set(double value) { return hn::Set(FloatTag(), static_cast<float>(value)); }
HWY_INLINE Int set(int value) { return hn::Set(IntTag(), value); }

// Cut down to a whole number, which for one that is whole may end one lower: as it is, and as an
// integer above kLargeBits. Holds up to 4 million, and is cheaper than a conversion, which has to
// look out for overflow.
struct Whole {
    Float number;
    Int integer;
};
constexpr double kLarge = 12582912;  // 1.5 * 2^23, where adding rounds to 1
constexpr std::int32_t kLargeBits = 0x4b400000;
HWY_INLINE Whole floor_or_below(Float value) {
    const Float shifted = hn::Add(hn::Sub(value, set(0.5)), set(kLarge));
    return {hn::Sub(shifted, set(kLarge)), hn::BitCast(IntTag(), shifted)};
}
HWY_INLINE Int to_integer(Float value) {  // the nearest
    return hn::Sub(hn::BitCast(IntTag(), hn::Add(value, set(kLarge))), set(kLargeBits));
}

// -- Where a pixel lies in the source, Eq. (3d_mapping) ------------------------------------------

// What a row of pixels has in common: along it, h x~ is affine in x. Taken from x, not from the
// pixel before, which would drift.
struct Row {
    Float ax, bx, ay, by, az, bz, kx, ky, kz, right, bottom;

    // In units of which there are so many in a source pixel.
    HWY_INLINE Row(const Reprojection& r, int y, double per_x = 1, double per_y = 1)
        : ax(set(per_x * r.h(0, 0))), bx(set(per_x * (r.h(0, 1) * y + r.h(0, 2)))),
          ay(set(per_y * r.h(1, 0))), by(set(per_y * (r.h(1, 1) * y + r.h(1, 2)))),
          az(set(r.h(2, 0))), bz(set(r.h(2, 1) * y + r.h(2, 2))), kx(set(per_x * r.k.x())),
          ky(set(per_y * r.k.y())), kz(set(r.k.z())), right(set(r.source_width - 1.0)),
          bottom(set(r.source_height - 1.0)) {}
};

// Points in the source, or anything where there is none.
struct Points {
    Float u, v, z, inverse_z;
};

// Eq. (3d_mapping) times the depth. `exact`: to the last bit or so, else to 1e-4 of u and v. Where
// a division is slow, by one reciprocal, and a Newton step for each quotient.
template <bool exact>
HWY_INLINE Points project(const Row& row, Float depth, Float x) {
    Points p;
    p.u = hn::MulAdd(depth, hn::MulAdd(row.ax, x, row.bx), row.kx);
    p.v = hn::MulAdd(depth, hn::MulAdd(row.ay, x, row.by), row.ky);
    p.z = hn::MulAdd(depth, hn::MulAdd(row.az, x, row.bz), row.kz);
#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3
    p.inverse_z = hn::ApproximateReciprocal(p.z);
#if HWY_TARGET == HWY_AVX2  // has 12 bits of it, the other 14
    p.inverse_z = hn::MulAdd(p.inverse_z, hn::NegMulAdd(p.z, p.inverse_z, set(1.0)), p.inverse_z);
#endif
    const Float u = hn::Mul(p.u, p.inverse_z), v = hn::Mul(p.v, p.inverse_z);
    p.u = exact ? hn::MulAdd(p.inverse_z, hn::NegMulAdd(p.z, u, p.u), u) : u;
    p.v = exact ? hn::MulAdd(p.inverse_z, hn::NegMulAdd(p.z, v, p.v), v) : v;
#else
    p.inverse_z = hn::Div(set(1.0), p.z);
    p.u = exact ? hn::Div(p.u, p.z) : hn::Mul(p.u, p.inverse_z);
    p.v = exact ? hn::Div(p.v, p.z) : hn::Mul(p.v, p.inverse_z);
#endif
    return p;
}

// Points that lie in front of the source camera, of pixels that have a depth, if it is finite: of
// infinite ones u and v are NaN.
HWY_INLINE Mask in_front(Float depth, const Points& p) {
    return hn::And(hn::Gt(depth, hn::Zero(FloatTag())), hn::Gt(p.z, set(kNearestZ)));
}

// Takes the points on the rim into the source. Where not valid, u and v are 0 then.
HWY_INLINE Mask confine(const Row& row, Float depth, Points& p) {
    const Float zero = hn::Zero(FloatTag()), rim = set(kRim);
    const Float u = hn::Min(hn::Max(p.u, zero), row.right);
    const Float v = hn::Min(hn::Max(p.v, zero), row.bottom);
    const Mask inside = hn::And(hn::Le(hn::Abs(hn::Sub(p.u, u)), rim),  // false for NaN
                                hn::Le(hn::Abs(hn::Sub(p.v, v)), rim));
    const Mask valid = hn::And(in_front(depth, p), inside);
    p.u = hn::IfThenElseZero(valid, u);
    p.v = hn::IfThenElseZero(valid, v);
    return valid;
}

HWY_INLINE Mask is_depth(Float depth) {  // false for NaN and inf
    return hn::And(hn::Gt(depth, hn::Zero(FloatTag())),
                   hn::Le(depth, set(std::numeric_limits<float>::max())));
}

// A row of the caller's depth.
struct DepthRow {
    const char* data;
    int bytes;  // a pixel's
    Float scale;

    HWY_INLINE DepthRow(const DepthView& depth, int y)
        : data(depth.view.row<char>(y)), bytes(depth.view.type == PixelType::u16 ? 2 : 4),
          scale(hn::Set(FloatTag(), depth.scale)) {}

    // From pixel x on, of `left` that there are; 0 past them.
    HWY_INLINE Float load(int x, int left) const {
        const char* from = data + static_cast<std::ptrdiff_t>(x) * bytes;
        HWY_ALIGN char room[kLanes * 4];
        if (left < kLanes) {
            std::memset(room, 0, sizeof room);
            std::memcpy(room, from, static_cast<std::size_t>(left) * bytes);
            from = room;
        }
        if (bytes == 4) return hn::LoadU(FloatTag(), reinterpret_cast<const float*>(from));
        const auto units = hn::LoadU(ShortTag(), reinterpret_cast<const std::uint16_t*>(from));
        return hn::Mul(scale, hn::ConvertTo(FloatTag(), hn::PromoteTo(IntTag(), units)));
    }
};

// -- What hides what -----------------------------------------------------------------------------

// The cell of points within the source, or on its rim.
HWY_INLINE Int cells_of(const CellGrid& grid, Float x, Float y) {
    const Float width = set(static_cast<double>(grid.width));
    return to_integer(hn::MulAdd(floor_or_below(y).number, width, floor_or_below(x).number));
}

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
        const Row row(reprojection, y, grid.per_pixel_x, grid.per_pixel_y);
        const DepthRow depths(depth, y);
        Float along = hn::Iota(FloatTag(), 0.0f);
        for (int x = 0; x < width; x += kLanes, along = hn::Add(along, set(double{kLanes}))) {
            const Float z = depths.load(x, width - x);
            splat(grid, z, project<false>(row, z, along), cells);
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

// -- The four pixels around a point --------------------------------------------------------------

// 32 bits from each of the byte offsets.
HWY_INLINE Int gather_words(const char* base, Int offsets) {
#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3
    return hn::GatherOffset(IntTag(), reinterpret_cast<const std::int32_t*>(base), offsets);
#else  // which others do one by one, and only where aligned
    HWY_ALIGN std::int32_t at[kLanes], words[kLanes];
    hn::Store(offsets, IntTag(), at);
    for (int i = 0; i < kLanes; ++i) std::memcpy(words + i, base + at[i], 4);
    return hn::Load(IntTag(), words);
#endif
}

HWY_INLINE Float gather_floats(const char* base, Int offsets) {
    return hn::BitCast(FloatTag(), gather_words(base, offsets));
}

template <int kByte>
HWY_INLINE Float byte_of(Int words) {
    return hn::ConvertTo(FloatTag(), hn::And(hn::ShiftRight<8 * kByte>(words), set(0xff)));
}
HWY_INLINE Float low_of(Int words) {
    return hn::ConvertTo(FloatTag(), hn::And(words, set(0xffff)));
}
HWY_INLINE Float high_of(Int words) {
    // Shifted as an unsigned number.
    const hn::RebindToUnsigned<IntTag> du;
    return hn::ConvertTo(FloatTag(),
                         hn::BitCast(IntTag(), hn::ShiftRight<16>(hn::BitCast(du, words))));
}

struct Pair {
    Float left, right;
};

// Horizontal neighbours of all channels, from the byte offset of the left one. What is read ends
// with the right one, or, of single bytes, within `last`, the last offset that has four bytes.
HWY_INLINE void gather_pairs(float, const char* base, Int offsets, Int, Pair (&out)[1]) {
#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3
    // Eight bytes at once: half as many loads.
    const FloatTag d;
    const hn::RepartitionToWide<IntTag> wide;
    const hn::Half<IntTag> half;
    const auto* words = reinterpret_cast<const std::int64_t*>(base);
    const auto low =
        hn::GatherOffset(wide, words, hn::PromoteTo(wide, hn::LowerHalf(half, offsets)));
    const auto high =
        hn::GatherOffset(wide, words, hn::PromoteTo(wide, hn::UpperHalf(half, offsets)));
    out[0] = {hn::ConcatEven(d, hn::BitCast(d, high), hn::BitCast(d, low)),
              hn::ConcatOdd(d, hn::BitCast(d, high), hn::BitCast(d, low))};
#else
    out[0] = {gather_floats(base, offsets), gather_floats(base + 4, offsets)};
#endif
}
HWY_INLINE void gather_pairs(float, const char* base, Int offsets, Int, Pair (&out)[3]) {
    for (int c = 0; c < 3; ++c)
        out[c] = {gather_floats(base + 4 * c, offsets), gather_floats(base + 4 * c + 12, offsets)};
}
HWY_INLINE void gather_pairs(std::uint16_t, const char* base, Int offsets, Int, Pair (&out)[1]) {
    const Int both = gather_words(base, offsets);
    out[0] = {low_of(both), high_of(both)};
}
HWY_INLINE void gather_pairs(std::uint16_t, const char* base, Int offsets, Int, Pair (&out)[3]) {
    const Int bg = gather_words(base, offsets), rb = gather_words(base + 4, offsets);
    const Int gr = gather_words(base + 8, offsets);
    out[0] = {low_of(bg), high_of(rb)};
    out[1] = {high_of(bg), low_of(gr)};
    out[2] = {low_of(rb), high_of(gr)};
}
HWY_INLINE void gather_pairs(std::uint8_t, const char* base, Int offsets, Int last,
                             Pair (&out)[1]) {
    const hn::RebindToUnsigned<IntTag> du;
    const Int from = hn::Min(offsets, last);
    const Int bits = hn::ShiftLeft<3>(hn::Sub(offsets, from));
    const auto words = hn::BitCast(du, gather_words(base, from));
    const Int both = hn::BitCast(IntTag(), hn::Shr(words, hn::BitCast(du, bits)));
    out[0] = {byte_of<0>(both), byte_of<1>(both)};
}
HWY_INLINE void gather_pairs(std::uint8_t, const char* base, Int offsets, Int, Pair (&out)[3]) {
    const Int bgrb = gather_words(base, offsets), rbgr = gather_words(base + 2, offsets);
    out[0] = {byte_of<0>(bgrb), byte_of<3>(bgrb)};
    out[1] = {byte_of<1>(bgrb), byte_of<2>(rbgr)};
    out[2] = {byte_of<2>(bgrb), byte_of<3>(rbgr)};
}

#if HWY_TARGET != HWY_SCALAR
// The same from one stretch of a row, into which all points fall: neighbours in the reference are
// neighbours in the source, save across a depth edge. A shuffle is far cheaper than a gather.
// `index` is the left pixel's place in the stretch, from 0 to window<T>() - 1, a power of two less
// one.
template <class T>
constexpr int window() {
    return sizeof(T) == 1 ? 16 : kLanes;
}
HWY_INLINE Pair pair_in_window(const float* row, Int index) {
    const FloatTag d;
    const auto lanes = hn::IndicesFromVec(d, index);
    return {hn::TableLookupLanes(hn::LoadU(d, row), lanes),
            hn::TableLookupLanes(hn::LoadU(d, row + 1), lanes)};
}
HWY_INLINE Pair pair_in_window(const std::uint16_t* row, Int index) {
    const IntTag d;
    const Int left = hn::PromoteTo(d, hn::LoadU(ShortTag(), row));
    const Int right = hn::PromoteTo(d, hn::LoadU(ShortTag(), row + 1));
    const Int both =
        hn::TableLookupLanes(hn::Or(left, hn::ShiftLeft<16>(right)), hn::IndicesFromVec(d, index));
    return {low_of(both), high_of(both)};
}
HWY_INLINE Pair pair_in_window(const std::uint8_t* row, Int index) {
    const hn::Repartition<std::uint8_t, IntTag> bytes;
    const auto places = hn::BitCast(bytes, hn::Or(index, set(static_cast<int>(0x80808000))));
    const auto in = [&](const std::uint8_t* from) HWY_ATTR {
        const auto looked_up = hn::TableLookupBytesOr0(hn::LoadDup128(bytes, from), places);
        return hn::ConvertTo(FloatTag(), hn::BitCast(IntTag(), looked_up));
    };
    return {in(row), in(row + 1)};
}
#endif

HWY_INLINE Float between(const Pair& top, const Pair& bottom, Float a, Float b) {
    const Float upper = hn::MulAdd(a, hn::Sub(top.right, top.left), top.left);
    const Float lower = hn::MulAdd(a, hn::Sub(bottom.right, bottom.left), bottom.left);
    return hn::MulAdd(b, hn::Sub(lower, upper), upper);
}

// -- A row of the registered image ---------------------------------------------------------------

HWY_INLINE void store(Float value, float* out) { hn::StoreU(value, FloatTag(), out); }
template <class T>
HWY_INLINE void store(Float value, T* out) {  // a mean of values in range is in range
    const hn::Rebind<T, FloatTag> d;
    hn::StoreU(hn::DemoteTo(d, to_integer(value)), d, out);  // which rounds
}

HWY_INLINE void store_pixels(const Float (&values)[1], float* out) { store(values[0], out); }
template <class T>
HWY_INLINE void store_pixels(const Float (&values)[1], T* out) {
    store(values[0], out);
}
template <class T>
HWY_INLINE void store_pixels(const Float (&values)[3], T* out) {
    HWY_ALIGN T planes[3][kLanes];
    for (int c = 0; c < 3; ++c) store(values[c], planes[c]);
    const hn::Rebind<T, FloatTag> d;
    hn::StoreInterleaved3(hn::Load(d, planes[0]), hn::Load(d, planes[1]), hn::Load(d, planes[2]), d,
                          out);
}

struct Source {
    const char* data;
    std::ptrdiff_t row_bytes;
    int width, height;
    int last;  // byte offset of the last four bytes

    HWY_INLINE explicit Source(const ImageView& view)
        : data(static_cast<const char*>(view.data)), row_bytes(view.row_bytes), width(view.width),
          height(view.height) {
        const std::ptrdiff_t last_row = std::max<std::ptrdiff_t>(0, (height - 1) * row_bytes);
        last = static_cast<int>(last_row) + width - 4;
    }
    template <class T>
    HWY_INLINE const T* at(int x, int y) const {
        return reinterpret_cast<const T*>(data + y * row_bytes) + x;
    }
};

// Those that something nearer hides, of points within the source.
HWY_INLINE Mask hidden(const CellGrid& grid, const Nearness* cells, const Points& p) {
    const Int cell =
        cells_of(grid, hn::Mul(p.u, set(grid.per_pixel_x)), hn::Mul(p.v, set(grid.per_pixel_y)));
    const Int found = gather_words(reinterpret_cast<const char*>(cells), hn::ShiftLeft<1>(cell));
    const Float nearest = hn::BitCast(FloatTag(), hn::ShiftLeft<16>(found));
    const Float bound =
        hn::MulAdd(p.inverse_z, set(1.0f + grid.relative_tolerance), set(grid.absolute_tolerance));
    return hn::Gt(nearest, bound);
}

HWY_INLINE Int code_of(Validity code) { return set(static_cast<int>(code)); }
HWY_INLINE void store_codes(Int codes, std::uint8_t* mask) {
    hn::StoreU(hn::DemoteTo(ByteTag(), codes), ByteTag(), mask);
}

#if HWY_TARGET != HWY_SCALAR
// The usual case, of one channel: all points are valid, between the same two rows and within a
// window of them. False where they are not, and nothing is written. The source must be wider than
// the window.
template <class T>
HWY_INLINE bool sample_window(const RowsTask& task, const Source& source, Float depth,
                              const Points& p, T* out, std::uint8_t* mask) {
    const FloatTag d;
    const IntTag di;
    constexpr int kWindow = window<T>();
    constexpr int kBefore = kWindow / 8;  // left of the first point may be some pixels
    const Whole x = floor_or_below(p.u), y = floor_or_below(p.v);
    // In vectors, where what is far outside may overflow.
    const int row = hn::GetLane(hn::Sub(y.integer, set(kLargeBits)));
    const int first = hn::GetLane(hn::Sub(x.integer, set(kLargeBits)));
    const int last_from = source.width - 1 - kWindow;
    const int from = std::clamp(first, kBefore, last_from + kBefore) - kBefore;
    if (static_cast<unsigned>(row) >= static_cast<unsigned>(source.height - 1)) return false;
    const Int index = hn::Sub(x.integer, set(from + kLargeBits));
    const Int apart =
        hn::Or(hn::Xor(y.integer, set(row + kLargeBits)), hn::AndNot(set(kWindow - 1), index));
    // Depths below kNearestZ may be valid, but are not usual.
    const Mask usual = hn::Gt(hn::Min(depth, p.z), set(kNearestZ));
    if (!hn::AllTrue(d, hn::And(hn::RebindMask(d, hn::Eq(apart, hn::Zero(di))), usual)))
        return false;
    const Pair top = pair_in_window(source.at<T>(from, row), index);
    const Pair bottom = pair_in_window(source.at<T>(from, row + 1), index);
    Float values[] = {between(top, bottom, hn::Sub(p.u, x.number), hn::Sub(p.v, y.number))};
    hn::StoreU(hn::Zero(ByteTag()), ByteTag(), mask);
    if (task.cells) {
        const Mask gone = hidden(*task.grid, task.cells, p);
        if (!hn::AllFalse(d, gone)) {
            store_codes(hn::IfThenElseZero(hn::RebindMask(di, gone), code_of(Validity::occluded)),
                        mask);
            if (task.hide) values[0] = hn::IfThenZeroElse(gone, values[0]);
        }
    }
    store_pixels(values, out);
    return true;
}
#endif

template <class T, int kChannels>
HWY_INLINE void sample_bilinear(const Source& source, const Points& p, Mask valid, T* out) {
    // The last cell serves its far edge too, so that all four pixels exist.
    const Float x = hn::Min(floor_or_below(p.u).number, set(source.width - 2.0));
    const Float y = hn::Min(floor_or_below(p.v).number, set(source.height - 2.0));
    const Int stride = set(static_cast<int>(source.row_bytes));
    const Int offsets = hn::Add(hn::Mul(to_integer(y), stride),
                                hn::Mul(to_integer(x), set(kChannels * int{sizeof(T)})));
    const Int last = set(source.last);
    Pair top[kChannels], bottom[kChannels];
    gather_pairs(T(), source.data, offsets, last, top);
    gather_pairs(T(), source.data, hn::Add(offsets, stride), last, bottom);
    Float values[kChannels];
    for (int c = 0; c < kChannels; ++c)
        values[c] =
            hn::IfThenElseZero(valid, between(top[c], bottom[c], hn::Sub(p.u, x), hn::Sub(p.v, y)));
    store_pixels(values, out);
}

// The pixel whose centre is next, as it is, so that counts of a radiometric source are never mixed.
template <class T, int kChannels>
HWY_INLINE void sample_nearest(const Source& source, const Points& p, Mask valid, T* out) {
    const IntTag di;
    HWY_ALIGN std::int32_t x[kLanes], y[kLanes], ok[kLanes];
    hn::Store(to_integer(p.u), di, x);
    hn::Store(to_integer(p.v), di, y);
    hn::Store(hn::VecFromMask(di, hn::RebindMask(di, valid)), di, ok);
    for (int i = 0; i < kLanes; ++i)
        for (int c = 0; c < kChannels; ++c)
            out[kChannels * i + c] = ok[i] ? source.at<T>(kChannels * x[i] + c, y[i])[0] : T{0};
}

// One vector of pixels.
template <class T, int kChannels>
HWY_INLINE void sample(const RowsTask& task, const Source& source, const Row& row, Float depth,
                       Float x, T* out, std::uint8_t* mask) {
    const FloatTag d;
    const IntTag di;
    Points p = project<true>(row, depth, x);
#if HWY_TARGET != HWY_SCALAR
    if constexpr (kChannels == 1)
        if (!task.nearest && source.width > window<T>() &&
            sample_window(task, source, depth, p, out, mask))
            return;
#endif
    Mask valid = confine(row, depth, p);
    Int codes = hn::IfThenElse(hn::RebindMask(di, is_depth(depth)), code_of(Validity::outside),
                               code_of(Validity::no_depth));
    codes = hn::IfThenZeroElse(hn::RebindMask(di, valid), codes);
    if (task.cells) {
        const Mask gone = hn::And(valid, hidden(*task.grid, task.cells, p));
        codes = hn::IfThenElse(hn::RebindMask(di, gone), code_of(Validity::occluded), codes);
        if (task.hide) valid = hn::AndNot(gone, valid);
    }
    store_codes(codes, mask);
    if (hn::AllFalse(d, valid)) std::fill_n(out, kLanes * kChannels, T{0});
    else if (task.nearest) sample_nearest<T, kChannels>(source, p, valid, out);
    else sample_bilinear<T, kChannels>(source, p, valid, out);
}

template <class T, int kChannels>
void register_rows_of(const RowsTask& task, int begin, int end) {
    const int width = task.depth.view.width;
    const Source source(task.source);
    T pixels[kLanes * kChannels];  // of the last, incomplete vector of a row
    std::uint8_t codes[kLanes];
    for (int y = begin; y < end; ++y) {
        const Row row(*task.reprojection, y);
        const DepthRow depth(task.depth, y);
        T* out = reinterpret_cast<T*>(static_cast<char*>(task.registered.data) +
                                      y * task.registered.row_bytes);
        std::uint8_t* mask = task.mask + static_cast<std::size_t>(y) * width;
        Float along = hn::Iota(FloatTag(), 0.0f);
        for (int x = 0; x < width; x += kLanes, along = hn::Add(along, set(double{kLanes}))) {
            const int left = width - x;
            const bool whole = left >= kLanes;
            sample<T, kChannels>(task, source, row, depth.load(x, left), along,
                                 whole ? out + kChannels * x : pixels, whole ? mask + x : codes);
            if (whole) continue;
            std::copy_n(pixels, kChannels * left, out + kChannels * x);
            std::copy_n(codes, left, mask + x);
        }
    }
}

template <class T>
void register_rows_of(const RowsTask& task, int begin, int end) {
    if (task.source.channels == 3) register_rows_of<T, 3>(task, begin, end);
    else register_rows_of<T, 1>(task, begin, end);
}

void register_rows(const RowsTask& task, int begin, int end) {
    switch (task.source.type) {
        case PixelType::u8: return register_rows_of<std::uint8_t>(task, begin, end);
        case PixelType::u16: return register_rows_of<std::uint16_t>(task, begin, end);
        case PixelType::f32: return register_rows_of<float>(task, begin, end);
    }
}

void map_rows(const RowsTask& task, int begin, int end, float* map) {
    const FloatTag d;
    const int width = task.depth.view.width;
    const Float none = set(std::numeric_limits<double>::quiet_NaN());
    for (int y = begin; y < end; ++y) {
        const Row row(*task.reprojection, y);
        const DepthRow depth(task.depth, y);
        float* out = map + 2 * static_cast<std::size_t>(y) * width;
        Float along = hn::Iota(d, 0.0f);
        for (int x = 0; x < width; x += kLanes, along = hn::Add(along, set(double{kLanes}))) {
            HWY_ALIGN float u[kLanes], v[kLanes];
            const Float metres = depth.load(x, width - x);
            Points p = project<true>(row, metres, along);
            Mask valid = confine(row, metres, p);
            if (task.cells && task.hide)
                valid = hn::AndNot(hidden(*task.grid, task.cells, p), valid);
            hn::Store(hn::IfThenElse(valid, p.u, none), d, u);
            hn::Store(hn::IfThenElse(valid, p.v, none), d, v);
            for (int i = 0; i < std::min(kLanes, width - x); ++i) {
                out[2 * (x + i)] = u[i];
                out[2 * (x + i) + 1] = v[i];
            }
        }
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
HWY_EXPORT(register_rows);
HWY_EXPORT(map_rows);

}  // namespace

void splat_rows(const Reprojection& reprojection, const DepthView& depth, const CellGrid& grid,
                int begin, int end, Nearness* cells) {
    HWY_DYNAMIC_DISPATCH(splat_rows)(reprojection, depth, grid, begin, end, cells);
}

void join_cells(const CellGrid& grid, const Nearness* parts, int count, int begin, int end,
                Nearness* out) {
    HWY_DYNAMIC_DISPATCH(join_cells)(grid, parts, count, begin, end, out);
}

void register_rows(const RowsTask& task, int begin, int end) {
    HWY_DYNAMIC_DISPATCH(register_rows)(task, begin, end);
}

void map_rows(const RowsTask& task, int begin, int end, float* out) {
    HWY_DYNAMIC_DISPATCH(map_rows)(task, begin, end, out);
}

}  // namespace xcalib
#endif

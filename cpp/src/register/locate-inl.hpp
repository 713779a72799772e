// From the caller's depth to the pixels and the cells of the source that points lie in.
// Included once for each instruction set.
#if defined(XCALIB_LOCATE_INL_) == defined(HWY_TARGET_TOGGLE)
#ifdef XCALIB_LOCATE_INL_
#undef XCALIB_LOCATE_INL_
#else
#define XCALIB_LOCATE_INL_
#endif

#include <hwy/cache_control.h>

#include <cstring>
#include <type_traits>

#include "geometry/projector-inl.hpp"
#include "register/register_rows.hpp"

HWY_BEFORE_NAMESPACE();
namespace xcalib {
namespace HWY_NAMESPACE {
namespace {

using ByteTag = hn::Rebind<std::uint8_t, FloatTag>;
using ShortTag = hn::Rebind<std::uint16_t, FloatTag>;

// Vectors of a row that are worked on together: one bit for each.
using Vectors = std::uint32_t;
constexpr int kVectors = 16;
static_assert(kVectors % kLanes == 0, "what is one number for each goes into whole vectors");

HWY_INLINE Vectors all_of(int count) { return (Vectors{1} << (count - 1) << 1) - 1; }
HWY_INLINE int first_of(Vectors vectors) {
    return static_cast<int>(hwy::Num0BitsBelowLS1Bit_Nonzero32(vectors));
}

// A bit for each lane.
HWY_INLINE Vectors bits(Mask mask) {
    // As many bytes are read as were written: a processor waits for others.
    std::uint8_t bytes[8];
    std::conditional_t<(kLanes > 8), std::uint16_t, std::uint8_t> out;
    hn::StoreMaskBits(FloatTag(), mask, bytes);
    std::memcpy(&out, bytes, sizeof out);
    return out;
}

HWY_INLINE float greatest(Float of) { return hn::GetLane(hn::MaxOfLanes(FloatTag(), of)); }

// Where the points of a row lie in the source, in the units of Row and shifted as it is, so that
// rounding cuts down to a whole number; u is NaN where there is none. And 1/z. By pixels.
struct RowPoints {
    float *u, *v, *inverse_z;

    HWY_INLINE RowPoints from(int x) const { return {u + x, v + x, inverse_z + x}; }
};

// A number plus kLarge is rounded to a whole one, of which the bits less kLargeBits are the
// integer. Holds up to 4 million, and is cheaper than a conversion, which has to look out for
// overflow.
constexpr double kLarge = 12582912;  // 1.5 * 2^23
constexpr std::int32_t kLargeBits = 0x4b400000;
// Cut down to a whole number, which for one that is whole may end one lower.
HWY_INLINE Float floor_or_below(Float value) {
    return hn::Sub(hn::Add(hn::Sub(value, set(0.5)), set(kLarge)), set(kLarge));
}
HWY_INLINE Int to_integer(Float value) {  // the nearest
    return hn::Sub(hn::BitCast(IntTag(), hn::Add(value, set(kLarge))), set(kLargeBits));
}

// The pixel left of and above each point, shifted by kLarge, and how far the point is from there.
struct Located {
    Float x, y, a, b, z, inverse_z;

    HWY_INLINE Float left() const { return hn::Sub(x, set(kLarge)); }
    HWY_INLINE Float top() const { return hn::Sub(y, set(kLarge)); }
    HWY_INLINE Points points() const {
        return {hn::Add(left(), a), hn::Add(top(), b), z, inverse_z};
    }
};

// In a row that is shifted by this rounding cuts down to a whole number.
constexpr double kHalfBack = -0.5;
HWY_INLINE Located locate(const Row& row, Float depth, Float x) {
    const Homogeneous p = multiplied(row, depth, x);
    Located out;
    out.z = p.z;
    out.inverse_z = reciprocal<true>(p.z);
    out.x = hn::MulAdd(p.u, out.inverse_z, set(kLarge));
    out.y = hn::MulAdd(p.v, out.inverse_z, set(kLarge));
    out.a = hn::Add(hn::MulSub(p.u, out.inverse_z, out.left()), set(0.5));
    out.b = hn::Add(hn::MulSub(p.v, out.inverse_z, out.top()), set(0.5));
    return out;
}

HWY_INLINE Located locate(const LensRow& row, Float depth, int column) {
    const Points p = project<true>(row, depth, column);
    Located out;
    out.z = p.z;
    out.inverse_z = p.inverse_z;
    out.x = hn::Add(p.u, set(kLarge));
    out.y = hn::Add(p.v, set(kLarge));
    out.a = hn::Add(hn::Sub(p.u, out.left()), set(0.5));
    out.b = hn::Add(hn::Sub(p.v, out.top()), set(0.5));
    return out;
}

HWY_INLINE Located locate(const AnyRow& row, Float depth, Float x, int column) {
    return row.bends ? locate(row.bent, depth, column) : locate(row.straight, depth, x);
}

// A row of depth: the caller's as it is, or one made of it.
struct DepthRow {
    const char* data;
    std::ptrdiff_t stride;  // [bytes] to the next
    int bytes;              // a pixel's
    Float scale;

    HWY_INLINE DepthRow(const DepthRows& rows, int y, DepthRows::Room& room) {
        const DepthView& depth = rows.given();
        const bool given = !rows.resizes();
        data = given ? depth.view.row<char>(y) : reinterpret_cast<const char*>(rows.row(y, room));
        stride = given ? depth.view.row_bytes : 0;
        bytes = given && depth.view.type == PixelType::u16 ? 2 : 4;
        scale = hn::Set(FloatTag(), depth.scale);
    }

    // From pixel x on, of which a vector is there.
    HWY_INLINE Float load(int x) const {
        return read(data + static_cast<std::ptrdiff_t>(x) * bytes);
    }
    // Depth comes from far: what is asked for a row ahead is there when it is due.
    HWY_INLINE void prefetch_next_row(int x) const {
        hwy::Prefetch(data + stride + static_cast<std::ptrdiff_t>(x) * bytes);
    }
    // The `left` that there are; 0 past them.
    HWY_INLINE Float load(int x, int left) const {
        if (left >= kLanes) return load(x);
        HWY_ALIGN char room[kLanes * 4] = {};
        std::memcpy(room, data + static_cast<std::ptrdiff_t>(x) * bytes,
                    static_cast<std::size_t>(left) * bytes);
        return read(room);
    }

   private:
    HWY_INLINE Float read(const char* from) const {
        if (bytes == 4) return hn::LoadU(FloatTag(), reinterpret_cast<const float*>(from));
        const auto units = hn::LoadU(ShortTag(), reinterpret_cast<const std::uint16_t*>(from));
        return hn::Mul(scale, hn::ConvertTo(FloatTag(), hn::PromoteTo(IntTag(), units)));
    }
};

#if HWY_TARGET != HWY_SCALAR
// What is nearest in the cells of a window of 2 kLanes and in those so many behind, at `index`: the
// upper half of a float.
HWY_INLINE Int nearest_in_window(const Nearness* from, int step, Int index) {
    const IntTag di;
    const hn::Repartition<Nearness, IntTag> pairs;
    const auto nearest = hn::Max(hn::LoadU(pairs, from), hn::LoadU(pairs, from + step));
    const Int both = hn::TableLookupLanes(
        hn::BitCast(di, nearest),
        hn::IndicesFromVec(di, hn::And(hn::ShiftRight<1>(index), set(kLanes - 1))));
    return hn::IfThenElse(hn::TestBit(index, set(1)),
                          hn::And(both, set(static_cast<int>(0xffff0000))),
                          hn::ShiftLeft<16>(both));
}
#endif

// The cell of points within the source, or on its rim.
HWY_INLINE Int cells_of(const CellGrid& grid, Float x, Float y) {
    const Float width = set(static_cast<double>(grid.width));
    return to_integer(hn::MulAdd(floor_or_below(y), width, floor_or_below(x)));
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace xcalib
HWY_AFTER_NAMESPACE();

#endif

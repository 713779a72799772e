// Where a vector of reference pixels lies in the source, Eq. (3d_mapping).
// Included once for each instruction set.
#if defined(XCALIB_PROJECT_INL_) == defined(HWY_TARGET_TOGGLE)
#ifdef XCALIB_PROJECT_INL_
#undef XCALIB_PROJECT_INL_
#else
#define XCALIB_PROJECT_INL_
#endif

#include <hwy/cache_control.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "base/vectors-inl.hpp"
#include "register/register_rows.hpp"

// x86 with eight lanes or more; of Highway's targets, the better has the lower number.
#undef XCALIB_X86_LANES
#if HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX2
#define XCALIB_X86_LANES 1
#else
#define XCALIB_X86_LANES 0
#endif

HWY_BEFORE_NAMESPACE();
namespace xcalib {
namespace HWY_NAMESPACE {
namespace {

using ByteTag = hn::Rebind<std::uint8_t, FloatTag>;
using ShortTag = hn::Rebind<std::uint16_t, FloatTag>;
constexpr int kLanes = static_cast<int>(hn::MaxLanes(FloatTag()));

HWY_INLINE Float set(double value) { return hn::Set(FloatTag(), static_cast<float>(value)); }
HWY_INLINE Int set(int value) { return hn::Set(IntTag(), value); }

// Vectors of a row that are worked on together: one bit for each.
using Vectors = std::uint32_t;
constexpr int kVectors = 16;
static_assert(kVectors % kLanes == 0, "what is one number for each goes into whole vectors");

HWY_INLINE Vectors all_of(int count) { return (Vectors{1} << (count - 1) << 1) - 1; }
HWY_INLINE int first_of(Vectors vectors) {
    return static_cast<int>(hwy::Num0BitsBelowLS1Bit_Nonzero32(vectors));
}

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

// What a row of pixels has in common: along it, h x~ is affine in x. Taken from x, not from the
// pixel before, which would drift.
struct Row {
    Float ax, bx, ay, by, az, bz, kx, ky, kz;

    // The points move by `shift`, in source pixels; then they are in units of which there are so
    // many in a source pixel.
    HWY_INLINE Row(const Reprojection& r, int y, double shift = 0, double per_x = 1,
                   double per_y = 1) {
        const auto constant = [&](int i) { return r.h(i, 1) * y + r.h(i, 2); };
        const auto of_x = [&](double x, double z) HWY_ATTR { return set(per_x * (x + shift * z)); };
        const auto of_y = [&](double x, double z) HWY_ATTR { return set(per_y * (x + shift * z)); };
        ax = of_x(r.h(0, 0), r.h(2, 0));
        bx = of_x(constant(0), constant(2));
        kx = of_x(r.k.x(), r.k.z());
        ay = of_y(r.h(1, 0), r.h(2, 0));
        by = of_y(constant(1), constant(2));
        ky = of_y(r.k.y(), r.k.z());
        az = set(r.h(2, 0));
        bz = set(constant(2));
        kz = set(r.k.z());
    }
};

// 1 / value, to the last bit or so, else to 1e-4.
template <bool exact>
HWY_INLINE Float reciprocal(Float value) {
#if XCALIB_X86_LANES                               // where a division is slow
    Float out = hn::ApproximateReciprocal(value);  // to 12 or, with 16 lanes, 14 bits
    constexpr int steps = (exact ? 1 : 0) + (HWY_TARGET == HWY_AVX2 ? 1 : 0);
    for (int i = 0; i < steps; ++i) out = hn::MulAdd(out, hn::NegMulAdd(value, out, set(1.0)), out);
    return out;
#else
    return hn::Div(set(1.0), value);
#endif
}

// Eq. (3d_mapping) times the depth, before the division.
struct Homogeneous {
    Float u, v, z;
};
HWY_INLINE Homogeneous multiplied(const Row& row, Float depth, Float x) {
    return {hn::MulAdd(depth, hn::MulAdd(row.ax, x, row.bx), row.kx),
            hn::MulAdd(depth, hn::MulAdd(row.ay, x, row.by), row.ky),
            hn::MulAdd(depth, hn::MulAdd(row.az, x, row.bz), row.kz)};
}

// Points in the source, or anything where there is none.
struct Points {
    Float u, v, z, inverse_z;
};

// To 1e-4 of u and v.
HWY_INLINE Points project_roughly(const Row& row, Float depth, Float x) {
    const Homogeneous p = multiplied(row, depth, x);
    const Float inverse_z = reciprocal<false>(p.z);
    return {hn::Mul(p.u, inverse_z), hn::Mul(p.v, inverse_z), p.z, inverse_z};
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

// Of a row that is shifted by this, rounding cuts down to a whole number.
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

// Points that lie in front of the source camera, of pixels that have a depth, if it is finite: of
// infinite ones u and v are NaN.
HWY_INLINE Mask in_front(Float depth, const Points& p) {
    return hn::And(hn::Gt(depth, hn::Zero(FloatTag())), hn::Gt(p.z, set(kNearestZ)));
}

// Of the pixels of a row, those of a greater depth lie in front of the source camera.
inline float least_depth(const Reprojection& r, int y, int width) {
    const double constant = r.h(2, 1) * y + r.h(2, 2);
    const double slowest = constant + std::min(0.0, r.h(2, 0) * (width - 1));  // z by depth
    if (!(slowest > 0)) return std::numeric_limits<float>::max();
    const double depth = std::max(kNearestZ, (kNearestZ - r.k.z()) / slowest);
    return static_cast<float>(std::min<double>(1.0001 * depth, std::numeric_limits<float>::max()));
}

// How far apart in the source the points of neighbouring pixels of a row are, of something far.
// [px]
inline double source_step(const Reprojection& r, int x, int y) {
    const double u = r.h(0, 1) * y + r.h(0, 2), z = r.h(2, 1) * y + r.h(2, 2);
    const double depth = r.h(2, 0) * x + z;
    return std::abs(r.h(0, 0) * z - r.h(2, 0) * u) / (depth * depth);
}

// Takes the points on the rim into the source. Where not valid, u and v are 0 then.
HWY_INLINE Mask confine(const Reprojection& r, Float depth, Points& p) {
    const Float zero = hn::Zero(FloatTag()), rim = set(kRim);
    const Float u = hn::Min(hn::Max(p.u, zero), set(r.source_width - 1.0));
    const Float v = hn::Min(hn::Max(p.v, zero), set(r.source_height - 1.0));
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
    std::ptrdiff_t stride;  // [bytes] to the next
    int bytes;              // a pixel's
    Float scale;

    HWY_INLINE DepthRow(const DepthView& depth, int y)
        : data(depth.view.row<char>(y)), stride(depth.view.row_bytes),
          bytes(depth.view.type == PixelType::u16 ? 2 : 4),
          scale(hn::Set(FloatTag(), depth.scale)) {}

    // From pixel x on, of which a vector is there.
    HWY_INLINE Float load(int x) const {
        return read(data + static_cast<std::ptrdiff_t>(x) * bytes);
    }
    // Depth comes from far: what is asked for a row ahead is there when it is due.
    HWY_INLINE void prefetch_next_row(int x) const {
        hwy::Prefetch(data + stride + static_cast<std::ptrdiff_t>(x) * bytes);
    }
    // Of `left` that there are; 0 past them.
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

// Where a vector of reference pixels lies in the source, Eq. (3d_mapping).
// Included once for each instruction set.
#if defined(XCALIB_PROJECTOR_INL_) == defined(HWY_TARGET_TOGGLE)
#ifdef XCALIB_PROJECTOR_INL_
#undef XCALIB_PROJECTOR_INL_
#else
#define XCALIB_PROJECTOR_INL_
#endif

#include <limits>

#include "base/vectors-inl.hpp"
#include "geometry/projector.hpp"

HWY_BEFORE_NAMESPACE();
namespace xcalib {
namespace HWY_NAMESPACE {
namespace {

// What a row of pixels has in common: along it, m x~ is affine in x. Taken from x, not from the
// pixel before, which would drift; its constants in double.
struct Row {
    Float ax, bx, ay, by, az, bz, kx, ky, kz;

    // The points move by `shift`, in source pixels; then they are in units of which there are so
    // many in a source pixel.
    HWY_INLINE Row(const PixelTransform& of, int y, double shift = 0, double per_x = 1,
                   double per_y = 1) {
        const auto constant = [&](int i) { return of.m(i, 1) * y + of.m(i, 2); };
        const auto of_x = [&](double x, double z) HWY_ATTR { return set(per_x * (x + shift * z)); };
        const auto of_y = [&](double x, double z) HWY_ATTR { return set(per_y * (x + shift * z)); };
        ax = of_x(of.m(0, 0), of.m(2, 0));
        bx = of_x(constant(0), constant(2));
        kx = of_x(of.c.x(), of.c.z());
        ay = of_y(of.m(1, 0), of.m(2, 0));
        by = of_y(constant(1), constant(2));
        ky = of_y(of.c.y(), of.c.z());
        az = set(of.m(2, 0));
        bz = set(constant(2));
        kz = set(of.c.z());
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

// Exactly, or to 1e-4 of u and v.
template <bool exact>
HWY_INLINE Points project(const Row& row, Float depth, Float x) {
    const Homogeneous p = multiplied(row, depth, x);
    const Float inverse_z = reciprocal<exact>(p.z);
    return {hn::Mul(p.u, inverse_z), hn::Mul(p.v, inverse_z), p.z, inverse_z};
}

// Points that lie in front of the source camera, of pixels that have a depth, if it is finite: of
// infinite ones u and v are NaN.
HWY_INLINE Mask in_front(Float depth, const Points& p) {
    return hn::And(hn::Gt(depth, hn::Zero(FloatTag())), hn::Gt(p.z, set(kNearestZ)));
}

HWY_INLINE Mask is_depth(Float depth) {  // false for NaN and inf
    return hn::And(hn::Gt(depth, hn::Zero(FloatTag())),
                   hn::Le(depth, set(std::numeric_limits<float>::max())));
}

// Takes the points on the rim into the source. Where not valid, u and v are 0 then.
HWY_INLINE Mask confine(const Projector& projector, Float depth, Points& p) {
    const Float zero = hn::Zero(FloatTag()), rim = set(kRim);
    const Float u = hn::Min(hn::Max(p.u, zero), set(projector.source_width - 1.0));
    const Float v = hn::Min(hn::Max(p.v, zero), set(projector.source_height - 1.0));
    const Mask inside = hn::And(hn::Le(hn::Abs(hn::Sub(p.u, u)), rim),  // false for NaN
                                hn::Le(hn::Abs(hn::Sub(p.v, v)), rim));
    const Mask valid = hn::And(in_front(depth, p), inside);
    p.u = hn::IfThenElseZero(valid, u);
    p.v = hn::IfThenElseZero(valid, v);
    return valid;
}

// The Validity codes of pixels of which these have a valid point.
HWY_INLINE Int codes_of(Float depth, Mask valid) {
    const auto code = [](Validity c) HWY_ATTR { return set(static_cast<int>(c)); };
    const Int codes = hn::IfThenElse(hn::RebindMask(IntTag(), is_depth(depth)),
                                     code(Validity::outside), code(Validity::no_depth));
    return hn::IfThenZeroElse(hn::RebindMask(IntTag(), valid), codes);
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace xcalib
HWY_AFTER_NAMESPACE();

#endif

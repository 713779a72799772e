// Where a vector of reference pixels lies in the source, Eq. (3d_mapping).
// Included once for each instruction set.
#if defined(XCALIB_PROJECTOR_INL_) == defined(HWY_TARGET_TOGGLE)
#ifdef XCALIB_PROJECTOR_INL_
#undef XCALIB_PROJECTOR_INL_
#else
#define XCALIB_PROJECTOR_INL_
#endif

#include <hwy/contrib/math/math-inl.h>

#include <array>
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

// -- Lenses --------------------------------------------------------------------------------------

// A lens for vectors: numbers, which are the same for all of a row.
struct VectorLens {
    enum class Kind { none, polynomial, rational, fisheye };
    Kind kind = Kind::none;
    std::array<float, Lens::kMaxCoefficients> c{};
    float most = 0;  // r2 up to here has an image

    VectorLens() = default;
    explicit VectorLens(const Lens& lens) {
        if (!lens.bends()) return;
        kind = lens.model() == LensModel::fisheye ? Kind::fisheye
               : lens.is_rational()               ? Kind::rational
                                                  : Kind::polynomial;
        for (std::size_t i = 0; i < c.size(); ++i) c[i] = static_cast<float>(lens.coefficient(i));
        const double r2 = lens.max_radius() * lens.max_radius();
        most = static_cast<float>(std::min<double>(r2, std::numeric_limits<float>::max()));
    }
};

// f of a lens, and df / dr2 where that is asked for.
struct Radial {
    Float f, slope;
};
template <bool with_slope>
HWY_INLINE Radial radial(const VectorLens& lens, Float r2) {
    const auto& c = lens.c;
    const Float one = set(1.0), none = hn::Zero(FloatTag());
    const auto horner = [](Float s, Float a, Float b) HWY_ATTR { return hn::MulAdd(s, b, a); };
    const auto at = [&](int i) HWY_ATTR { return hn::Set(FloatTag(), c[i]); };
    const auto times = [&](double n, int i) HWY_ATTR { return set(n * c[i]); };
    if (lens.kind == VectorLens::Kind::fisheye) {
        // At the axis itself theta / r is 1.
        const Float r = hn::Sqrt(hn::Max(r2, set(1e-12)));
        const Float theta = hn::Atan(FloatTag(), r), s = hn::Mul(theta, theta);
        const Float f = hn::Div(
            hn::Mul(theta,
                    horner(s, one, horner(s, at(0), horner(s, at(1), horner(s, at(2), at(3)))))),
            r);
        if constexpr (!with_slope) return {f, none};
        const Float rise = horner(
            s, one,
            horner(s, times(3, 0), horner(s, times(5, 1), horner(s, times(7, 2), times(9, 3)))));
        const Float square = hn::Mul(r, r);
        return {f,
                hn::Div(hn::Sub(hn::Div(rise, hn::Add(one, square)), f), hn::Add(square, square))};
    }
    const Float n = horner(r2, one, horner(r2, at(0), horner(r2, at(1), at(4))));
    Float rise = none;
    if constexpr (with_slope) rise = horner(r2, at(0), horner(r2, times(2, 1), times(3, 4)));
    if (lens.kind == VectorLens::Kind::polynomial) return {n, rise};
    const Float d = horner(r2, one, horner(r2, at(5), horner(r2, at(6), at(7))));
    const Float f = hn::Div(n, d);
    if constexpr (!with_slope) return {f, none};
    const Float fall = horner(r2, at(5), horner(r2, times(2, 6), times(3, 7)));
    return {f, hn::Div(hn::NegMulAdd(f, fall, rise), d)};
}

// Where a lens shows points (Lens::distort): NaN where it shows none.
struct Shown {
    Float x, y;
};
HWY_INLINE Shown shown_by(const VectorLens& lens, Float x, Float y) {
    if (lens.kind == VectorLens::Kind::none) return {x, y};
    const Float r2 = hn::MulAdd(x, x, hn::Mul(y, y));
    Float h = radial<false>(lens, r2).f;
    h = hn::IfThenElse(hn::Lt(r2, hn::Set(FloatTag(), lens.most)), h,
                       set(std::numeric_limits<double>::quiet_NaN()));
    if (lens.kind == VectorLens::Kind::fisheye) return {hn::Mul(x, h), hn::Mul(y, h)};
    const Float p1 = hn::Set(FloatTag(), lens.c[2]), p2 = hn::Set(FloatTag(), lens.c[3]);
    const Float tangential = hn::MulAdd(p1, y, hn::Mul(p2, x));
    h = hn::Add(h, hn::Add(tangential, tangential));
    return {hn::MulAdd(x, h, hn::Mul(p2, r2)), hn::MulAdd(y, h, hn::Mul(p1, r2))};
}

// Its derivative there (Lens::derivative).
struct VectorSlope {
    Float xx, xy, yy;
};
HWY_INLINE VectorSlope slope_of(const VectorLens& lens, Float x, Float y) {
    const Float one = set(1.0), zero = hn::Zero(FloatTag());
    if (lens.kind == VectorLens::Kind::none) return {one, zero, one};
    const Radial r = radial<true>(lens, hn::MulAdd(x, x, hn::Mul(y, y)));
    const bool brown = lens.kind != VectorLens::Kind::fisheye;
    const Float two_p1 = set(brown ? 2.0 * lens.c[2] : 0.0);
    const Float two_p2 = set(brown ? 2.0 * lens.c[3] : 0.0);
    const Float h = hn::Add(r.f, hn::MulAdd(two_p1, y, hn::Mul(two_p2, x)));
    const Float steep = hn::Add(r.slope, r.slope);
    const Float hx = hn::MulAdd(steep, x, two_p2), hy = hn::MulAdd(steep, y, two_p1);
    return {hn::Add(h, hn::MulAdd(x, hx, hn::Mul(two_p2, x))),
            hn::MulAdd(x, hy, hn::Mul(two_p2, y)),
            hn::Add(h, hn::MulAdd(y, hy, hn::Mul(two_p1, y)))};
}

// A row of pixels where lenses bend, in the units of Row: its rays, if the reference has a lens,
// from their table; its points bent by the source's lens. Numbers, not vectors: there are too many
// to keep them all at hand.
struct LensRow {
    const float *ray_x = nullptr, *ray_y = nullptr;  // null: affine in x
    std::array<float, 9> m{};                        // by rows: of rays, or of (x, 1)
    std::array<float, 3> c{};
    VectorLens lens;
    // What K does to what the lens shows; without a lens in m and c.
    float fx = 1, skew = 0, cx = 0, fy = 1, cy = 0;

    HWY_INLINE LensRow() = default;
    HWY_INLINE LensRow(const Projector& of, int y, double shift = 0, double per_x = 1,
                       double per_y = 1)
        : lens(of.source_lens) {
        const auto single = [](double value) { return static_cast<float>(value); };
        const bool bends = of.source_lens.bends();
        Eigen::Matrix3d units;
        units << per_x, 0, per_x * shift, 0, per_y, per_y * shift, 0, 0, 1;
        Eigen::Matrix3d all = bends ? of.to_camera.m : units * of.to_image.m;
        const Eigen::Vector3d constant = bends ? of.to_camera.c : units * of.to_image.c;
        if (of.rays) {
            ray_x = of.rays->row_x(y);
            ray_y = of.rays->row_y(y);
        } else {
            all.col(2) += y * all.col(1);
            all.col(1).setZero();
        }
        for (int i = 0; i < 9; ++i) m[i] = single(all(i / 3, i % 3));
        for (int i = 0; i < 3; ++i) c[i] = single(constant[i]);
        if (!bends) return;
        const Eigen::Matrix3d k = units * of.source_K;
        fx = single(k(0, 0));
        skew = single(k(0, 1));
        cx = single(k(0, 2));
        fy = single(k(1, 1));
        cy = single(k(1, 2));
    }

    template <int kComponent>
    HWY_INLINE Float at(Float depth, Float x, Float y) const {
        const auto part = [&](int i)
                              HWY_ATTR { return hn::Set(FloatTag(), m[3 * kComponent + i]); };
        Float sum = hn::MulAdd(part(0), x, part(2));
        if (ray_x) sum = hn::MulAdd(part(1), y, sum);
        return hn::MulAdd(depth, sum, hn::Set(FloatTag(), c[kComponent]));
    }
};

// The points that the source's lens bends, of pixels from column `column` on.
template <bool exact>
HWY_INLINE Points project(const LensRow& row, Float depth, int column) {
    const auto number = [](float value) HWY_ATTR { return hn::Set(FloatTag(), value); };
    const Float x = row.ray_x ? load(row.ray_x + column)
                              : hn::Add(hn::Iota(FloatTag(), 0.0f), set(double(column)));
    const Float y = row.ray_x ? load(row.ray_y + column) : x;
    const Float z = row.at<2>(depth, x, y);
    const Float inverse_z = reciprocal<exact>(z);
    const Float u = hn::Mul(row.at<0>(depth, x, y), inverse_z);
    const Float v = hn::Mul(row.at<1>(depth, x, y), inverse_z);
    if (row.lens.kind == VectorLens::Kind::none) return {u, v, z, inverse_z};
    const Shown shown = shown_by(row.lens, u, v);
    return {
        hn::MulAdd(number(row.fx), shown.x, hn::MulAdd(number(row.skew), shown.y, number(row.cx))),
        hn::MulAdd(number(row.fy), shown.y, number(row.cy)), z, inverse_z};
}

// A row of pixels, whatever the cameras. `along` is the column of each.
struct AnyRow {
    Row straight;
    LensRow bent;
    bool bends;

    HWY_INLINE AnyRow(const Projector& of, int y, double shift = 0, double per_x = 1,
                      double per_y = 1)
        : straight(of.to_image, y, shift, per_x, per_y), bends(of.bends()) {
        if (bends) bent = LensRow(of, y, shift, per_x, per_y);
    }
};
template <bool exact>
HWY_INLINE Points project(const AnyRow& row, Float depth, Float along, int column) {
    if (row.bends) return project<exact>(row.bent, depth, column);
    return project<exact>(row.straight, depth, along);
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

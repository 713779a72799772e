#include "objective/nec_pass.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "base/kernel_targets.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "objective/nec_pass.cpp"
#include <hwy/foreach_target.h>
// After it.
#include "objective/pass-inl.hpp"

#ifndef XCALIB_NEC_PASS_ONCE
#define XCALIB_NEC_PASS_ONCE
namespace xcalib {
namespace {

// A row of the warped source: NaN where it is not valid, and past its end.
struct WarpedRow {
    std::vector<float> value;
    std::vector<float> derivative;  // dI'/dp, parameter-major
    int stride;

    WarpedRow(int width, int count)
        : value(width + kRoom, NAN), derivative((width + kRoom) * count), stride(width + kRoom) {}
};

// What the rows of a pass have in common.
struct Pass {
    const NecFrame& frame;
    Projector projector;
    ProjectionDerivative derivative;
    const Parameters& parameters;
    PointRow points;
    std::vector<float> u, v, du, dv;
    std::vector<std::uint8_t> validity;

    Pass(const NecFrame& frame, const Rig& rig, const Parameters& parameters)
        : frame(frame), projector(rig), derivative(rig), parameters(parameters),
          points(parameters.size() > 0 ? frame.depth.width : 0), u(frame.depth.width + kRoom, NAN),
          v(frame.depth.width + kRoom, NAN), du(frame.depth.width + kRoom),
          dv(frame.depth.width + kRoom), validity(frame.depth.width) {}
};

// The stencil of one row of pixels: its own row, its neighbours, and the reference's edges there.
struct Stencil {
    const WarpedRow *above, *here, *below;
    const float *reference_x, *reference_y;  // may be read past the end
    int width;
    float floor, cap;  // of the source's gradient
};

struct MeanSums {
    double magnitudes, count;
};

}  // namespace
}  // namespace xcalib
#endif

HWY_BEFORE_NAMESPACE();
namespace xcalib {
namespace HWY_NAMESPACE {
namespace {

void warp_row(Pass& pass, int y, WarpedRow& row) {
    const FloatTag d;
    const int width = pass.frame.depth.width;
    const float* depth = pass.frame.depth.row(y);
    map_row(pass.projector, depth, y, width, pass.u.data(), pass.v.data(), pass.validity.data());
    const Image& source = pass.frame.source;
    const float* HWY_RESTRICT pixels = source.pixels.data();
    const bool slopes = pass.parameters.size() > 0;
    for (int x = 0; x < width; x += lanes()) {
        const Float u = load(pass.u.data() + x);
        const Mask ok = hn::Eq(u, u);
        const Cell cell =
            cell_at(hn::IfThenElseZero(ok, u), hn::IfThenElseZero(ok, load(pass.v.data() + x)),
                    source.width, source.height);
        const Pair top = gather_pairs(pixels, cell.top), bottom = gather_pairs(pixels, cell.bottom);
        const Sampled s = interpolated(cell, top.first, top.second, bottom.first, bottom.second);
        const Float none = hn::Set(d, std::numeric_limits<float>::quiet_NaN());
        hn::StoreU(hn::IfThenElse(ok, s.value, none), d, row.value.data() + x);
        if (!slopes) continue;
        hn::StoreU(s.du, d, pass.du.data() + x);
        hn::StoreU(s.dv, d, pass.dv.data() + x);
    }
}

// dI'/dp of the row that was warped last.
void derive_row(Pass& pass, int y, WarpedRow& row) {
    const int width = pass.frame.depth.width;
    const float* depth = pass.frame.depth.row(y);
    seen_row(pass.projector, depth, y, width, pass.points);
    derivative_row(pass.derivative, pass.parameters, depth, pass.du.data(), pass.dv.data(), width,
                   pass.points, row.derivative.data(), row.stride);
}

// Central differences of three rows, for a vector of pixels from x on.
struct Difference {
    Float x, y;
};
HWY_INLINE Difference difference(const float* above, const float* here, const float* below, int x) {
    const Float half = hn::Set(FloatTag(), 0.5f);
    return {hn::Mul(half, hn::Sub(load(here + x + 1), load(here + x - 1))),
            hn::Mul(half, hn::Sub(load(below + x), load(above + x)))};
}

// The source's gradient, and where the whole stencil is valid.
struct Gradient {
    Mask valid;
    Float x, y, magnitude;
};
HWY_INLINE Gradient gradient_at(const Stencil& s, int x) {
    const Difference g =
        difference(s.above->value.data(), s.here->value.data(), s.below->value.data(), x);
    const Float squares = hn::MulAdd(g.x, g.x, hn::Mul(g.y, g.y));
    const Float any = hn::Add(squares, load(s.here->value.data() + x));  // NaN if one of them is
    return {hn::Eq(any, any), g.x, g.y, hn::Sqrt(squares)};
}

// The soft floor, and d(clamped)/d(gradient): along n, `along`; across n, `across`. The clamped
// vector is the gradient times `across`.
struct Clamped {
    Float along, across;
};
HWY_INLINE Clamped clamped(Float magnitude, float floor, float cap) {
    const FloatTag d;
    const Mask saturated = hn::Ge(magnitude, hn::Set(d, cap));
    const Float rise =
        hn::IfThenElse(saturated, hn::Set(d, cap - floor), hn::Sub(magnitude, hn::Set(d, floor)));
    return {hn::IfThenElseZero(hn::Not(saturated), hn::Set(d, 1.0f)), hn::Div(rise, magnitude)};
}

NecSums sum_row(const Stencil& s) {
    const FloatTag d;
    Float aa = hn::Zero(d), vv = aa, av = aa, magnitudes = aa;
    for (int x = 1; x < s.width - 1; x += lanes()) {
        const Gradient g = gradient_at(s, x);
        const Float ax = hn::IfThenElseZero(g.valid, load(s.reference_x + x));
        const Float ay = hn::IfThenElseZero(g.valid, load(s.reference_y + x));
        const Float a2 = hn::MulAdd(ax, ax, hn::Mul(ay, ay));
        const Mask edge = hn::And(g.valid, hn::Gt(g.magnitude, hn::Set(d, s.floor)));
        const Float across = clamped(g.magnitude, s.floor, s.cap).across;
        const Float vx = hn::IfThenElseZero(edge, hn::Mul(across, g.x));
        const Float vy = hn::IfThenElseZero(edge, hn::Mul(across, g.y));
        const Float v2 = hn::MulAdd(vx, vx, hn::Mul(vy, vy));
        aa = hn::Add(aa, a2);
        vv = hn::Add(vv, v2);
        av = hn::Add(av, hn::Abs(hn::MulAdd(ax, vx, hn::Mul(ay, vy))));
        magnitudes = hn::Add(magnitudes, hn::Sqrt(hn::Mul(a2, v2)));
    }
    return {total(aa), total(vv), total(av), total(magnitudes)};
}

MeanSums sum_magnitudes(const Stencil& s) {
    const FloatTag d;
    Float magnitudes = hn::Zero(d), count = magnitudes;
    for (int x = 1; x < s.width - 1; x += lanes()) {
        const Gradient g = gradient_at(s, x);
        magnitudes = hn::Add(magnitudes, hn::IfThenElseZero(g.valid, g.magnitude));
        count = hn::Add(count, hn::IfThenElseZero(g.valid, hn::Set(d, 1.0f)));
    }
    return {total(magnitudes), total(count)};
}

// Appends the row's edge pixels to the tile. Of the sums it gives aa and magnitudes.
NecSums append_row(const Stencil& s, PassTile& tile) {
    const FloatTag d;
    const int stride = s.here->stride;
    Float aa = hn::Zero(d), magnitudes = aa;
    for (int x = 1; x < s.width - 1; x += lanes()) {
        const Gradient g = gradient_at(s, x);
        const Float ax = hn::IfThenElseZero(g.valid, load(s.reference_x + x));
        const Float ay = hn::IfThenElseZero(g.valid, load(s.reference_y + x));
        const Float a2 = hn::MulAdd(ax, ax, hn::Mul(ay, ay));
        aa = hn::Add(aa, a2);
        const Mask edge = hn::And(g.valid, hn::Gt(g.magnitude, hn::Set(d, s.floor)));
        if (hn::AllFalse(d, edge)) continue;
        const Clamped v = clamped(g.magnitude, s.floor, s.cap);
        const Float vx = hn::Mul(v.across, g.x), vy = hn::Mul(v.across, g.y);
        const Float v2 = hn::MulAdd(vx, vx, hn::Mul(vy, vy));
        magnitudes = hn::Add(magnitudes, hn::IfThenElseZero(edge, hn::Sqrt(hn::Mul(a2, v2))));
        const Float inverse = hn::Div(hn::Set(d, 1.0f), g.magnitude);
        const Float nx = hn::Mul(g.x, inverse), ny = hn::Mul(g.y, inverse);
        const Float turn = hn::Sub(v.along, v.across);
        for (int p = 0; p < tile.count; ++p) {
            const Difference dg = difference(s.above->derivative.data() + p * stride,
                                             s.here->derivative.data() + p * stride,
                                             s.below->derivative.data() + p * stride, x);
            const Float radial = hn::Mul(turn, hn::MulAdd(nx, dg.x, hn::Mul(ny, dg.y)));
            put(tile, p, edge, hn::MulAdd(radial, nx, hn::Mul(v.across, dg.x)),
                hn::MulAdd(radial, ny, hn::Mul(v.across, dg.y)));
        }
        put(tile, tile.count, edge, vx, vy);
        // The reference's gradient, with the polarity of the source.
        const Mask opposed = hn::Lt(hn::MulAdd(ax, vx, hn::Mul(ay, vy)), hn::Zero(d));
        put(tile, tile.count + 1, edge, hn::IfThenElse(opposed, hn::Neg(ax), ax),
            hn::IfThenElse(opposed, hn::Neg(ay), ay));
        finish(tile, edge);
    }
    NecSums sums;
    sums.aa = total(aa);
    sums.magnitudes = total(magnitudes);
    return sums;
}

void flush_tile(PassTile& tile) { flush(tile); }

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace xcalib
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace xcalib {
namespace {

HWY_EXPORT(warp_row);
HWY_EXPORT(derive_row);
HWY_EXPORT(sum_row);
HWY_EXPORT(sum_magnitudes);
HWY_EXPORT(append_row);
HWY_EXPORT(flush_tile);

// Calls work(stencil) for each row that has one.
template <class Work>
void for_each_row(const NecFrame& frame, const Rig& rig, const Parameters& parameters,
                  WorkTimes* times, const Work& work) {
    PassClock clock(times, parameters.size() > 0);
    const int width = frame.depth.width, height = frame.depth.height;
    if (width < 3 || height < 3) return;
    Pass pass(frame, rig, parameters);
    const WarpedRow empty(width, parameters.size());
    std::array<WarpedRow, 3> rows{empty, empty, empty};
    const auto warp = [&](int y) {
        clock.warp([&] { HWY_DYNAMIC_DISPATCH(warp_row)(pass, y, rows[y % 3]); });
        if (parameters.size() > 0) HWY_DYNAMIC_DISPATCH(derive_row)(pass, y, rows[y % 3]);
    };
    warp(0);
    warp(1);
    for (int y = 1; y + 1 < height; ++y) {
        warp(y + 1);
        const std::size_t offset = static_cast<std::size_t>(y) * width;
        work(Stencil{&rows[(y - 1) % 3], &rows[y % 3], &rows[(y + 1) % 3],
                     frame.reference.x.data() + offset, frame.reference.y.data() + offset, width,
                     frame.floor * frame.source_mean, kEdgeCap * frame.source_mean});
    }
}

}  // namespace

NecSums nec_sums(const NecFrame& frame, const Rig& rig, WorkTimes* times) {
    NecSums sums;
    for_each_row(frame, rig, Parameters(0), times, [&](const Stencil& stencil) {
        const NecSums row = HWY_DYNAMIC_DISPATCH(sum_row)(stencil);
        sums.aa += row.aa;
        sums.vv += row.vv;
        sums.av += row.av;
        sums.magnitudes += row.magnitudes;
    });
    return sums;
}

float warped_mean_gradient(const NecFrame& frame, const Rig& rig) {
    double sum = 0, count = 0;
    for_each_row(frame, rig, Parameters(0), nullptr, [&](const Stencil& stencil) {
        const MeanSums row = HWY_DYNAMIC_DISPATCH(sum_magnitudes)(stencil);
        sum += row.magnitudes;
        count += row.count;
    });
    return count > 0 ? static_cast<float>(sum / count) : 0.0f;
}

NecGram nec_gram(const NecFrame& frame, const Rig& rig, const Parameters& parameters,
                 WorkTimes* times, Eigen::MatrixXd* pixels) {
    NecGram out;
    PassTile tile(parameters.size());
    if (pixels) pixels->resize(parameters.size() + 2, 0);
    tile.pixels = pixels;
    for_each_row(frame, rig, parameters, times, [&](const Stencil& stencil) {
        const NecSums row = HWY_DYNAMIC_DISPATCH(append_row)(stencil, tile);
        out.sums.aa += row.aa;
        out.sums.magnitudes += row.magnitudes;
    });
    HWY_DYNAMIC_DISPATCH(flush_tile)(tile);
    out.gram = tile.gram();
    const Eigen::Index v = parameters.size(), a = v + 1;
    out.sums.vv = out.gram(v, v);
    out.sums.av = out.gram(a, v);
    return out;
}

}  // namespace xcalib
#endif

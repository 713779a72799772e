#include "nec_pass.hpp"

#include <array>
#include <cmath>
#include <vector>

#include "map_row.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "nec_pass.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#ifndef XCALIB_NEC_PASS_ONCE
#define XCALIB_NEC_PASS_ONCE
namespace xcalib {
namespace {

constexpr int kRoom = 64;  // past the end of a row: more than any vector holds

// A row of the warped source. Past its end nothing is valid.
struct WarpedRow {
    std::vector<float> u, v, value, du, dv;
    std::vector<std::int32_t> ok;   // -1 where valid
    std::vector<float> derivative;  // dI'/dp, parameter-major
    std::vector<std::uint8_t> validity;
    int stride;

    WarpedRow(int width, int count)
        : u(width + kRoom, NAN), v(width + kRoom, NAN), value(width + kRoom), du(width + kRoom),
          dv(width + kRoom), ok(width + kRoom), derivative((width + kRoom) * count),
          validity(width), stride(width + kRoom) {}
};

// The stencil of one row of pixels: its own row, its neighbours, and the reference's edges there.
struct Stencil {
    const WarpedRow *above, *here, *below;
    const float *reference_x, *reference_y;  // with room past the end
    int width;
    float floor, cap;  // of the source's gradient
};

struct RowSums {
    double aa = 0, vv = 0, av = 0, magnitudes = 0;
};

// Edge pixels in columns of [dv/dp ..., v, s a n_R], x and y components apart.
struct Tile {
    int count;  // parameters
    int columns, capacity;
    int filled = 0;
    std::vector<float> x, y;
    std::vector<double> wide;
    std::vector<std::int32_t> edges;  // pixels of the current row
    std::vector<double> gram;         // columns^2

    Tile(int parameters, int width)
        : count(parameters), columns((parameters + 2 + 3) / 4 * 4), capacity(width + 256 + kRoom),
          x(columns * capacity), y(columns * capacity), wide(columns * capacity),
          edges(width + kRoom), gram(columns * columns) {}
    bool full(int width) const { return filled + width + kRoom > capacity; }
};

}  // namespace
}  // namespace xcalib
#endif

HWY_BEFORE_NAMESPACE();
namespace xcalib {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
using FloatTag = hn::ScalableTag<float>;
using IntTag = hn::RebindToSigned<FloatTag>;
using Float = hn::Vec<FloatTag>;
using Mask = hn::Mask<FloatTag>;

// A sum of floats, in double.
using HalfTag = hn::Half<FloatTag>;
using DoubleTag = hn::Rebind<double, HalfTag>;
struct Sum {
    hn::Vec<DoubleTag> low, high;
};
HWY_INLINE Sum no_sum() { return {hn::Zero(DoubleTag()), hn::Zero(DoubleTag())}; }
HWY_INLINE void add(Sum& sum, Float v) {
    sum.low = hn::Add(sum.low, hn::PromoteTo(DoubleTag(), hn::LowerHalf(HalfTag(), v)));
#if HWY_TARGET != HWY_SCALAR
    sum.high = hn::Add(sum.high, hn::PromoteTo(DoubleTag(), hn::UpperHalf(HalfTag(), v)));
#endif
}
HWY_INLINE double total(const Sum& sum) {
    return hn::GetLane(hn::SumOfLanes(DoubleTag(), hn::Add(sum.low, sum.high)));
}

template <int kCount>
void derivative_row(const ProjectionDerivative& derivative, const Pinhole& reference,
                    const float* HWY_RESTRICT depth, int y, int width, WarpedRow& row) {
    const double ray_y = (y - reference.cy) / reference.fy;
    const float y0 = static_cast<float>(ray_y);
    const float x0 = static_cast<float>(-(reference.cx + reference.skew * ray_y) / reference.fx);
    const float step = static_cast<float>(1 / reference.fx);
    const float* HWY_RESTRICT du = row.du.data();
    const float* HWY_RESTRICT dv = row.dv.data();
    float* HWY_RESTRICT out = row.derivative.data();
    const int stride = row.stride;
    const ProjectionDerivative d = derivative;
    // Where a pixel is not valid the result may be anything: no stencil reads it.
    for (int x = 0; x < width; ++x)
        d.chain<kCount>(x0 + step * static_cast<float>(x), y0, depth[x], du[x], dv[x], out + x,
                        stride);
}

void warp_row(const NecFrame& frame, const Rig& rig, const Reprojection& reprojection,
              const ProjectionDerivative& derivative, int count, int y, WarpedRow& row) {
    const FloatTag d;
    const IntTag di;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const int width = frame.depth.width;
    const float* depth = frame.depth.row(y);
    map_row_inline(reprojection, depth, y, width, row.u.data(), row.v.data(), row.validity.data());
    const float* HWY_RESTRICT pixels = frame.source.pixels.data();
    const auto source_width = hn::Set(di, frame.source.width);
    const auto one = hn::Set(di, 1);
    const auto last_x = hn::Set(di, frame.source.width - 2);
    const auto last_y = hn::Set(di, frame.source.height - 2);
    for (int x = 0; x < width; x += lanes) {
        const Float u_or_nan = hn::LoadU(d, row.u.data() + x);
        const Mask ok = hn::Eq(u_or_nan, u_or_nan);
        const Float u = hn::IfThenElseZero(ok, u_or_nan);
        const Float v = hn::IfThenElseZero(ok, hn::LoadU(d, row.v.data() + x));
        // The last cell serves its far edge too, so that all four pixels exist.
        const auto cell_x = hn::Min(hn::ConvertTo(di, u), last_x);
        const auto cell_y = hn::Min(hn::ConvertTo(di, v), last_y);
        const auto top = hn::Add(hn::Mul(cell_y, source_width), cell_x);
        const auto bottom = hn::Add(top, source_width);
        const Float a = hn::Sub(u, hn::ConvertTo(d, cell_x));
        const Float b = hn::Sub(v, hn::ConvertTo(d, cell_y));
        const Float t0 = hn::GatherIndex(d, pixels, top);
        const Float t1 = hn::GatherIndex(d, pixels, hn::Add(top, one));
        const Float b0 = hn::GatherIndex(d, pixels, bottom);
        const Float b1 = hn::GatherIndex(d, pixels, hn::Add(bottom, one));
        const Float top_step = hn::Sub(t1, t0), bottom_step = hn::Sub(b1, b0);
        const Float upper = hn::MulAdd(a, top_step, t0);
        const Float lower = hn::MulAdd(a, bottom_step, b0);
        const Float down = hn::Sub(lower, upper);
        hn::StoreU(hn::IfThenElseZero(ok, hn::MulAdd(b, down, upper)), d, row.value.data() + x);
        hn::StoreU(hn::VecFromMask(di, hn::RebindMask(di, ok)), di, row.ok.data() + x);
        if (count == 0) continue;
        const Float across = hn::MulAdd(b, hn::Sub(bottom_step, top_step), top_step);
        hn::StoreU(hn::IfThenElseZero(ok, across), d, row.du.data() + x);
        hn::StoreU(hn::IfThenElseZero(ok, down), d, row.dv.data() + x);
    }
    if (count == kNumWithoutReference)
        derivative_row<kNumWithoutReference>(derivative, rig.reference, depth, y, width, row);
    else if (count == kNumParameters)
        derivative_row<kNumParameters>(derivative, rig.reference, depth, y, width, row);
}

// A vector of pixels from x on: where the stencil is valid, and the source's gradient.
struct Gradient {
    Mask valid;
    Float x, y, magnitude;
};

HWY_INLINE Gradient gradient_at(const Stencil& s, int x) {
    const FloatTag d;
    const IntTag di;
    auto ok = hn::And(hn::LoadU(di, s.above->ok.data() + x), hn::LoadU(di, s.below->ok.data() + x));
    for (int side = -1; side <= 1; ++side)
        ok = hn::And(ok, hn::LoadU(di, s.here->ok.data() + x + side));
    const float* here = s.here->value.data() + x;
    const Float half = hn::Set(d, 0.5f);
    Gradient g;
    g.valid = hn::RebindMask(d, hn::MaskFromVec(ok));
    g.x = hn::Mul(half, hn::Sub(hn::LoadU(d, here + 1), hn::LoadU(d, here - 1)));
    g.y = hn::Mul(half, hn::Sub(hn::LoadU(d, s.below->value.data() + x),
                                hn::LoadU(d, s.above->value.data() + x)));
    g.magnitude = hn::Sqrt(hn::MulAdd(g.x, g.x, hn::Mul(g.y, g.y)));
    return g;
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
    return {hn::IfThenElse(saturated, hn::Zero(d), hn::Set(d, 1.0f)), hn::Div(rise, magnitude)};
}

RowSums sum_row(const Stencil& s) {
    const FloatTag d;
    const int lanes = static_cast<int>(hn::Lanes(d));
    Sum aa = no_sum(), vv = aa, av = aa, magnitudes = aa;
    for (int x = 1; x < s.width - 1; x += lanes) {
        const Gradient g = gradient_at(s, x);
        const Float ax = hn::IfThenElseZero(g.valid, hn::LoadU(d, s.reference_x + x));
        const Float ay = hn::IfThenElseZero(g.valid, hn::LoadU(d, s.reference_y + x));
        const Float a2 = hn::MulAdd(ax, ax, hn::Mul(ay, ay));
        add(aa, a2);
        const Mask edge = hn::And(g.valid, hn::Gt(g.magnitude, hn::Set(d, s.floor)));
        const Float across = clamped(g.magnitude, s.floor, s.cap).across;
        const Float vx = hn::IfThenElseZero(edge, hn::Mul(across, g.x));
        const Float vy = hn::IfThenElseZero(edge, hn::Mul(across, g.y));
        const Float v2 = hn::MulAdd(vx, vx, hn::Mul(vy, vy));
        add(vv, v2);
        add(av, hn::Abs(hn::MulAdd(ax, vx, hn::Mul(ay, vy))));
        add(magnitudes, hn::Sqrt(hn::Mul(a2, v2)));
    }
    return {total(aa), total(vv), total(av), total(magnitudes)};
}

// Appends the row's edge pixels to the tile. Of the sums it gives aa and magnitudes.
RowSums append_row(const Stencil& s, Tile& tile) {
    const FloatTag d;
    const IntTag di;
    const int lanes = static_cast<int>(hn::Lanes(d));
    Sum aa = no_sum();
    std::int32_t* edges = tile.edges.data();
    int count = 0;
    for (int x = 1; x < s.width - 1; x += lanes) {
        const Gradient g = gradient_at(s, x);
        const Float ax = hn::IfThenElseZero(g.valid, hn::LoadU(d, s.reference_x + x));
        const Float ay = hn::IfThenElseZero(g.valid, hn::LoadU(d, s.reference_y + x));
        add(aa, hn::MulAdd(ax, ax, hn::Mul(ay, ay)));
        const Mask edge = hn::And(g.valid, hn::Gt(g.magnitude, hn::Set(d, s.floor)));
        count += static_cast<int>(
            hn::CompressStore(hn::Iota(di, x), hn::RebindMask(di, edge), di, edges + count));
    }
    for (int i = count; i < count + lanes; ++i) edges[i] = 1;  // read, and written over later

    const Float half = hn::Set(d, 0.5f), zero = hn::Zero(d);
    const auto one = hn::Set(di, 1);
    const int stride = s.here->stride;
    Sum magnitudes = no_sum();
    for (int i = 0; i < count; i += lanes) {
        const auto x = hn::LoadU(di, edges + i);
        const auto left = hn::Sub(x, one), right = hn::Add(x, one);
        const auto difference = [&](const float* l, const float* r, const float* a,
                                    const float* b) HWY_ATTR {
            return std::array<Float, 2>{
                hn::Mul(half, hn::Sub(hn::GatherIndex(d, r, right), hn::GatherIndex(d, l, left))),
                hn::Mul(half, hn::Sub(hn::GatherIndex(d, b, x), hn::GatherIndex(d, a, x)))};
        };
        const auto g = difference(s.here->value.data(), s.here->value.data(), s.above->value.data(),
                                  s.below->value.data());
        const Float magnitude = hn::Sqrt(hn::MulAdd(g[0], g[0], hn::Mul(g[1], g[1])));
        const Clamped v = clamped(magnitude, s.floor, s.cap);
        const Float vx = hn::Mul(v.across, g[0]), vy = hn::Mul(v.across, g[1]);
        const Float ax = hn::GatherIndex(d, s.reference_x, x);
        const Float ay = hn::GatherIndex(d, s.reference_y, x);
        const Mask opposed = hn::Lt(hn::MulAdd(ax, vx, hn::Mul(ay, vy)), zero);
        float* out_x = tile.x.data() + tile.filled + i;
        float* out_y = tile.y.data() + tile.filled + i;
        const auto put = [&](int column, Float in_x, Float in_y) HWY_ATTR {
            hn::StoreU(in_x, d, out_x + column * tile.capacity);
            hn::StoreU(in_y, d, out_y + column * tile.capacity);
        };
        const Float inverse = hn::Div(hn::Set(d, 1.0f), magnitude);
        const Float nx = hn::Mul(g[0], inverse), ny = hn::Mul(g[1], inverse);
        const Float turn = hn::Sub(v.along, v.across);
        for (int p = 0; p < tile.count; ++p) {
            const float* here = s.here->derivative.data() + p * stride;
            const auto dg = difference(here, here, s.above->derivative.data() + p * stride,
                                       s.below->derivative.data() + p * stride);
            const Float radial = hn::Mul(turn, hn::MulAdd(nx, dg[0], hn::Mul(ny, dg[1])));
            put(p, hn::MulAdd(radial, nx, hn::Mul(v.across, dg[0])),
                hn::MulAdd(radial, ny, hn::Mul(v.across, dg[1])));
        }
        put(tile.count, vx, vy);
        put(tile.count + 1, hn::IfThenElse(opposed, hn::Neg(ax), ax),
            hn::IfThenElse(opposed, hn::Neg(ay), ay));
        const Float both =
            hn::Mul(hn::MulAdd(ax, ax, hn::Mul(ay, ay)), hn::MulAdd(vx, vx, hn::Mul(vy, vy)));
        const Mask counted = hn::RebindMask(d, hn::Lt(hn::Iota(di, i), hn::Set(di, count)));
        add(magnitudes, hn::IfThenElseZero(counted, hn::Sqrt(both)));
    }
    tile.filled += count;
    RowSums sums;
    sums.aa = total(aa);
    sums.magnitudes = total(magnitudes);
    return sums;
}

// gram += the tile's columns multiplied with one another, in double. Lower triangle, by blocks of
// two by four; columns past the last are zero.
void add_gram(const std::vector<float>& values, Tile& tile) {
    const hn::ScalableTag<double> d;
    using Double = hn::Vec<decltype(d)>;
    const int lanes = static_cast<int>(hn::Lanes(d));
    const int filled = (tile.filled + lanes - 1) / lanes * lanes;
    const int used = tile.count + 2;
    for (int c = 0; c < used; ++c) {
        const float* HWY_RESTRICT from = values.data() + c * tile.capacity;
        double* HWY_RESTRICT to = tile.wide.data() + c * tile.capacity;
        for (int i = 0; i < tile.filled; ++i) to[i] = from[i];
        for (int i = tile.filled; i < filled; ++i) to[i] = 0;
    }
    for (int i = 0; i < used; i += 2)
        for (int j = 0; j <= i + 1; j += 4) {
            const double* rows[2];
            const double* columns[4];
            for (int k = 0; k < 2; ++k) rows[k] = tile.wide.data() + (i + k) * tile.capacity;
            for (int k = 0; k < 4; ++k) columns[k] = tile.wide.data() + (j + k) * tile.capacity;
            Double s00 = hn::Zero(d), s01 = s00, s02 = s00, s03 = s00;
            Double s10 = s00, s11 = s00, s12 = s00, s13 = s00;
            for (int n = 0; n < filled; n += lanes) {
                const Double r0 = hn::LoadU(d, rows[0] + n), r1 = hn::LoadU(d, rows[1] + n);
                const Double c0 = hn::LoadU(d, columns[0] + n), c1 = hn::LoadU(d, columns[1] + n);
                const Double c2 = hn::LoadU(d, columns[2] + n), c3 = hn::LoadU(d, columns[3] + n);
                s00 = hn::MulAdd(r0, c0, s00);
                s01 = hn::MulAdd(r0, c1, s01);
                s02 = hn::MulAdd(r0, c2, s02);
                s03 = hn::MulAdd(r0, c3, s03);
                s10 = hn::MulAdd(r1, c0, s10);
                s11 = hn::MulAdd(r1, c1, s11);
                s12 = hn::MulAdd(r1, c2, s12);
                s13 = hn::MulAdd(r1, c3, s13);
            }
            const auto add = [&](int row, int column, Double sum) HWY_ATTR {
                tile.gram[(i + row) * tile.columns + j + column] +=
                    hn::GetLane(hn::SumOfLanes(d, sum));
            };
            add(0, 0, s00), add(0, 1, s01), add(0, 2, s02), add(0, 3, s03);
            add(1, 0, s10), add(1, 1, s11), add(1, 2, s12), add(1, 3, s13);
        }
}

void flush(Tile& tile) {
    add_gram(tile.x, tile);
    add_gram(tile.y, tile);
    tile.filled = 0;
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace xcalib
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace xcalib {
namespace {

HWY_EXPORT(warp_row);
HWY_EXPORT(sum_row);
HWY_EXPORT(append_row);
HWY_EXPORT(flush);

// Calls work(stencil) for each row that has one.
template <class Work>
void for_each_row(const NecFrame& frame, const Rig& rig, int count, const Work& work) {
    const int width = frame.depth.width, height = frame.depth.height;
    if (width < 3 || height < 3) return;
    const Reprojection reprojection(rig);
    const ProjectionDerivative derivative(rig);
    std::array<WarpedRow, 3> rows{WarpedRow(width, count), WarpedRow(width, count),
                                  WarpedRow(width, count)};
    std::vector<float> reference_x(width + kRoom), reference_y(width + kRoom);
    const auto warp = [&](int y) {
        HWY_DYNAMIC_DISPATCH(warp_row)
        (frame, rig, reprojection, derivative, count, y, rows[y % 3]);
    };
    warp(0);
    warp(1);
    for (int y = 1; y + 1 < height; ++y) {
        warp(y + 1);
        const std::size_t offset = static_cast<std::size_t>(y) * width;
        std::copy_n(frame.reference.x.data() + offset, width, reference_x.data());
        std::copy_n(frame.reference.y.data() + offset, width, reference_y.data());
        work(Stencil{&rows[(y - 1) % 3], &rows[y % 3], &rows[(y + 1) % 3], reference_x.data(),
                     reference_y.data(), width, kEdgeFloor * frame.source_mean,
                     kEdgeCap * frame.source_mean});
    }
}

}  // namespace

NecSums nec_sums(const NecFrame& frame, const Rig& rig) {
    NecSums sums;
    for_each_row(frame, rig, 0, [&](const Stencil& stencil) {
        const RowSums row = HWY_DYNAMIC_DISPATCH(sum_row)(stencil);
        sums.aa += row.aa;
        sums.vv += row.vv;
        sums.av += row.av;
        sums.magnitudes += row.magnitudes;
    });
    return sums;
}

NecGram nec_gram(const NecFrame& frame, const Rig& rig, int count, Eigen::MatrixXd* rows) {
    const int width = frame.depth.width, used = count + 2;
    NecGram out;
    Tile tile(count, width);
    const auto flush_tile = [&] {
        if (rows) {
            const Eigen::Index first = rows->cols();
            rows->conservativeResize(used, first + 2 * tile.filled);
            for (int i = 0; i < tile.filled; ++i)
                for (int c = 0; c < used; ++c) {
                    (*rows)(c, first + 2 * i) = tile.x[c * tile.capacity + i];
                    (*rows)(c, first + 2 * i + 1) = tile.y[c * tile.capacity + i];
                }
        }
        HWY_DYNAMIC_DISPATCH(flush)(tile);
    };
    if (rows) rows->resize(used, 0);
    for_each_row(frame, rig, count, [&](const Stencil& stencil) {
        if (tile.full(width)) flush_tile();
        const RowSums row = HWY_DYNAMIC_DISPATCH(append_row)(stencil, tile);
        out.aa += row.aa;
        out.magnitudes += row.magnitudes;
    });
    flush_tile();
    out.gram =
        Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
            tile.gram.data(), tile.columns, tile.columns)
            .topLeftCorner(used, used);
    return out;
}

}  // namespace xcalib
#endif

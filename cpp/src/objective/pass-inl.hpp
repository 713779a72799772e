// The passes' inner loops, compiled for each instruction set by the files that include this within
// Highway's foreach_target.

// Highway's own guard: once for each target.
#if defined(XCALIB_PASS_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef XCALIB_PASS_INL_HPP
#undef XCALIB_PASS_INL_HPP
#else
#define XCALIB_PASS_INL_HPP
#endif

#include "base/vectors-inl.hpp"
#include "objective/pass_rows.hpp"
#include "objective/projection_derivative.hpp"

HWY_BEFORE_NAMESPACE();
namespace xcalib {
namespace HWY_NAMESPACE {
namespace {

// Four neighbours of a point in the source, of which each vector holds one, and what of the point
// lies beyond the first.
struct Cell {
    Int top, bottom;  // indices of the left ones
    Float a, b;
};
HWY_INLINE Cell cell_at(Float u, Float v, int width, int height) {
    const FloatTag d;
    const IntTag di;
    // The last cell serves its far edge too, so that all four pixels exist.
    const Int x = hn::Min(hn::ConvertTo(di, u), hn::Set(di, width - 2));
    const Int y = hn::Min(hn::ConvertTo(di, v), hn::Set(di, height - 2));
    const Int top = hn::Add(hn::Mul(y, hn::Set(di, width)), x);
    return {top, hn::Add(top, hn::Set(di, width)), hn::Sub(u, hn::ConvertTo(d, x)),
            hn::Sub(v, hn::ConvertTo(d, y))};
}

// Two neighbouring floats from each index on.
struct Pair {
    Float first, second;
};
HWY_INLINE Pair gather_pairs(const float* HWY_RESTRICT values, Int index) {
    const FloatTag d;
#if HWY_TARGET == HWY_AVX2 || HWY_TARGET <= HWY_AVX3
    // Eight bytes at once: half as many loads.
    const hn::RepartitionToWide<IntTag> wide;
    const hn::Half<IntTag> half;
    const auto* words = reinterpret_cast<const std::int64_t*>(values);
    const Int bytes = hn::ShiftLeft<2>(index);
    const auto low = hn::GatherOffset(wide, words, hn::PromoteTo(wide, hn::LowerHalf(half, bytes)));
    const auto high =
        hn::GatherOffset(wide, words, hn::PromoteTo(wide, hn::UpperHalf(half, bytes)));
    return {hn::ConcatEven(d, hn::BitCast(d, high), hn::BitCast(d, low)),
            hn::ConcatOdd(d, hn::BitCast(d, high), hn::BitCast(d, low))};
#else
    return {hn::GatherIndex(d, values, index), hn::GatherIndex(d, values + 1, index)};
#endif
}

struct Sampled {
    Float value, du, dv;
};
HWY_INLINE Sampled interpolated(const Cell& cell, Float t0, Float t1, Float b0, Float b1) {
    const Float top_step = hn::Sub(t1, t0), bottom_step = hn::Sub(b1, b0);
    const Float upper = hn::MulAdd(cell.a, top_step, t0);
    const Float down = hn::Sub(hn::MulAdd(cell.a, bottom_step, b0), upper);
    return {hn::MulAdd(cell.b, down, upper),
            hn::MulAdd(cell.b, hn::Sub(bottom_step, top_step), top_step), down};
}

template <int kParameter, bool kBends>
void partial_row(const ProjectionDerivative& derivative, const PointRow& row,
                 const float* HWY_RESTRICT depth, const float* HWY_RESTRICT du,
                 const float* HWY_RESTRICT dv, int width, float* HWY_RESTRICT out) {
    const ProjectionDerivative d = derivative;
    const float* HWY_RESTRICT ray_x = row.ray_x.data();
    const float* HWY_RESTRICT ray_y = row.ray_y.data();
    const float* HWY_RESTRICT px = row.x.data();
    const float* HWY_RESTRICT py = row.y.data();
    const float* HWY_RESTRICT pz = row.inverse_z.data();
    const float* HWY_RESTRICT rx = row.rx.data();
    const float* HWY_RESTRICT ry = row.ry.data();
    const float* HWY_RESTRICT rz = row.rz.data();
    const float* HWY_RESTRICT qx = row.qx.data();
    const float* HWY_RESTRICT qy = row.qy.data();
    const float* HWY_RESTRICT qz = row.qz.data();
    const float* HWY_RESTRICT shown_x = kBends ? row.shown_x.data() : px;
    const float* HWY_RESTRICT shown_y = kBends ? row.shown_y.data() : py;
    const float* HWY_RESTRICT xx = row.reference.xx.data();
    const float* HWY_RESTRICT xy = row.reference.xy.data();
    const float* HWY_RESTRICT yy = row.reference.yy.data();
    for (int x = 0; x < width; ++x) {
        SeenPoint p{ray_x[x], ray_y[x], rx[x], ry[x],      rz[x],
                    px[x],    py[x],    pz[x], shown_x[x], shown_y[x]};
        if constexpr (kBends) p.reference = {xx[x], xy[x], yy[x]};
        out[x] = d.partial<kParameter, kBends>(p, depth[x], {du[x], dv[x], qx[x], qy[x], qz[x]});
    }
}

// df/dX_S of a row.
template <bool kBends>
void slope_row(const ProjectionDerivative& derivative, const float* HWY_RESTRICT du,
               const float* HWY_RESTRICT dv, int width, PointRow& row) {
    const ProjectionDerivative d = derivative;
    const float* HWY_RESTRICT px = row.x.data();
    const float* HWY_RESTRICT py = row.y.data();
    const float* HWY_RESTRICT pz = row.inverse_z.data();
    const float* HWY_RESTRICT xx = row.source.xx.data();
    const float* HWY_RESTRICT xy = row.source.xy.data();
    const float* HWY_RESTRICT yy = row.source.yy.data();
    float* HWY_RESTRICT qx = row.qx.data();
    float* HWY_RESTRICT qy = row.qy.data();
    float* HWY_RESTRICT qz = row.qz.data();
    for (int x = 0; x < width; ++x) {
        SeenPoint p{0, 0, 0, 0, 0, px[x], py[x], pz[x], 0, 0};
        if constexpr (kBends) p.source = {xx[x], xy[x], yy[x]};
        const ProjectionDerivative::Slope s = d.slope<kBends>(p, du[x], dv[x]);
        qx[x] = s.qx;
        qy[x] = s.qy;
        qz[x] = s.qz;
    }
}

// df by the parameters, parameter-major, for a row of df/du and df/dv.
template <bool kBends>
void derivative_row_of(const ProjectionDerivative& derivative, const Parameters& parameters,
                       const float* HWY_RESTRICT depth, const float* HWY_RESTRICT du,
                       const float* HWY_RESTRICT dv, int width, PointRow& row,
                       float* HWY_RESTRICT out, int stride) {
    slope_row<kBends>(derivative, du, dv, width, row);
    for (int i = 0; i < parameters.size(); ++i)
        ProjectionDerivative::each<kNumParameters>([&](auto p) {
            if (parameters[i] == p)
                partial_row<p, kBends>(derivative, row, depth, du, dv, width, out + i * stride);
        });
}
void derivative_row(const ProjectionDerivative& derivative, const Parameters& parameters,
                    const float* HWY_RESTRICT depth, const float* HWY_RESTRICT du,
                    const float* HWY_RESTRICT dv, int width, PointRow& row, float* HWY_RESTRICT out,
                    int stride) {
    if (row.bends())
        derivative_row_of<true>(derivative, parameters, depth, du, dv, width, row, out, stride);
    else derivative_row_of<false>(derivative, parameters, depth, du, dv, width, row, out, stride);
}

// sums += the products of the columns. Lower triangle, by blocks of two by four.
void add_products(PassTile& tile) {
    const FloatTag d;
    const int used = tile.count + 2, n = lanes();
    for (int i = 0; i < used; i += 2)
        for (int j = 0; j <= i + 1; j += 4) {
            const int step = tile.capacity;
            Float s00 = hn::Zero(d), s01 = s00, s02 = s00, s03 = s00;
            Float s10 = s00, s11 = s00, s12 = s00, s13 = s00;
            for (const float* values : {tile.x.data(), tile.y.data()}) {
                const float* r = values + i * step;
                const float* c = values + j * step;
                for (int k = 0; k < tile.filled; k += n) {
                    const Float r0 = load(r + k), r1 = load(r + step + k);
                    const Float c0 = load(c + k), c1 = load(c + step + k);
                    const Float c2 = load(c + 2 * step + k), c3 = load(c + 3 * step + k);
                    s00 = hn::MulAdd(r0, c0, s00);
                    s01 = hn::MulAdd(r0, c1, s01);
                    s02 = hn::MulAdd(r0, c2, s02);
                    s03 = hn::MulAdd(r0, c3, s03);
                    s10 = hn::MulAdd(r1, c0, s10);
                    s11 = hn::MulAdd(r1, c1, s11);
                    s12 = hn::MulAdd(r1, c2, s12);
                    s13 = hn::MulAdd(r1, c3, s13);
                }
            }
            double* out = tile.sums.data() + i * tile.columns + j;
            out[0] += total(s00), out[1] += total(s01), out[2] += total(s02), out[3] += total(s03);
            out += tile.columns;
            out[0] += total(s10), out[1] += total(s11), out[2] += total(s12), out[3] += total(s13);
        }
}

void flush(PassTile& tile) {
    const int used = tile.count + 2;
    for (int c = 0; c < used; ++c)
        for (std::vector<float>* part : {&tile.x, &tile.y})
            std::fill_n(part->data() + c * tile.capacity + tile.filled, lanes(), 0.0f);
    if (tile.pixels) {
        const Eigen::Index first = tile.pixels->cols();
        tile.pixels->conservativeResize(used, first + 2 * tile.filled);
        for (int i = 0; i < tile.filled; ++i)
            for (int c = 0; c < used; ++c) {
                (*tile.pixels)(c, first + 2 * i) = tile.x[c * tile.capacity + i];
                (*tile.pixels)(c, first + 2 * i + 1) = tile.y[c * tile.capacity + i];
            }
    }
    add_products(tile);
    tile.filled = 0;
}

// Appends the pixels of a vector that `taken` has: first each column in turn, then `finish`.
HWY_INLINE void put(PassTile& tile, int column, Mask taken, Float x, Float y) {
    const FloatTag d;
    const int at = column * tile.capacity + tile.filled;
    hn::StoreU(hn::Compress(x, taken), d, tile.x.data() + at);
    hn::StoreU(hn::Compress(y, taken), d, tile.y.data() + at);
}
HWY_INLINE void finish(PassTile& tile, Mask taken) {
    tile.filled += static_cast<int>(hn::CountTrue(FloatTag(), taken));
    if (tile.filled > PassTile::kPixels - lanes()) flush(tile);
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace xcalib
HWY_AFTER_NAMESPACE();

#endif

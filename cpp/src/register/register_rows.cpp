#include "register/register_rows.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#define HWY_WANT_AVX3_DL  // which Highway leaves out unless asked
#include "base/kernel_targets.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "register/register_rows.cpp"
#include <hwy/foreach_target.h>

#include "register/sample-inl.hpp"
#include "register/stretch-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace xcalib {
namespace HWY_NAMESPACE {
namespace {

// Where a pixel is made of what is no number, it has no value: as outside of the source.
void drop_not_finite(float* row, int width, int channels, std::uint8_t* mask) {
    const auto is_finite = [](float value) { return std::isfinite(value); };
    for (int x = 0; x < width; ++x) {
        float* pixel = row + x * channels;
        if (std::all_of(pixel, pixel + channels, is_finite)) continue;
        std::fill_n(pixel, channels, 0.0f);
        if (mask[x] == static_cast<std::uint8_t>(Validity::valid))
            mask[x] = static_cast<std::uint8_t>(Validity::outside);
    }
}

HWY_INLINE bool all_finite(const float* values, int count) {
    const FloatTag d;
    Float not_zero = hn::Zero(d);  // what is not finite less itself is no number
    for (int i = 0; i < count; i += kLanes) {
        const Float some = load(values + i, count - i);
        not_zero = hn::Or(not_zero, hn::Sub(some, some));
    }
    return hn::AllTrue(d, hn::Eq(not_zero, hn::Zero(d)));
}

// Where the pixels of a row lie that is looked at a vector at a time.
struct SlowRow {
    const RowsTask& task;
    const AnyRow& row;
    const DepthRow& depths;
    const HiddenRow& hidden;

    HWY_INLINE Float depth(int x) const { return depths.load(x, task.depth->width() - x); }
    HWY_INLINE static Float along(int x) {
        return hn::Add(hn::Iota(FloatTag(), 0.0f), set(double(x)));
    }
    HWY_INLINE Located locate(int x) const {
        return HWY_NAMESPACE::locate(row, depth(x), along(x), x);
    }
    // Of valid ones those that something hides.
    HWY_INLINE Mask gone(int x, const Points& p, Mask valid) const {
        if (task.cells) return hn::And(valid, HWY_NAMESPACE::hidden(*task.grid, task.cells, p));
        const int vector = x / kLanes;
        if (task.row_grid && (hidden.may_be_hidden(vector) >> vector % kVectors) & 1)
            return hn::And(valid, hidden.hidden(x));
        return hn::MaskFromVec(hn::Zero(FloatTag()));
    }
};

// The rows [begin, end) in the order in which shadows fall, after those that they fall from.
struct RowOrder {
    Shadows shadows;
    int first, count, before;

    HWY_INLINE RowOrder(const RowsTask& task, int begin, int end) : count(end - begin) {
        if (task.row_grid) shadows = task.row_grid->shadows(begin, end);
        first = shadows.down ? begin : end - 1;
        const int most = shadows.down ? begin : task.depth->height() - end;
        before = std::min(shadows.reach, most);
    }
    HWY_INLINE int row(int i) const { return shadows.down ? first + i : first - i; }
};

// Puts the pixels of a row from x on, in `units` of a pixel. The greatest 1/z of them.
HWY_INLINE Float put(const SlowRow& row, const HiddenRow& hidden, int x, double units) {
    const FloatTag d;
    const Float nowhere = set(std::numeric_limits<double>::quiet_NaN());
    const RowPoints to = hidden.points();
    Float nearest = hn::Zero(d);
    for (; x < row.task.depth->width(); x += kLanes) {
        const Points p = row.locate(x).points();
        const Mask somewhere = in_front(row.depth(x), p);
        const Float u = hn::IfThenElse(somewhere, p.u, nowhere);
        hn::Store(hn::MulAdd(u, set(units), set(kHalfBack)), d, to.u + x);
        hn::Store(hn::MulAdd(p.v, set(units), set(kHalfBack)), d, to.v + x);
        hn::Store(p.inverse_z, d, to.inverse_z + x);
        nearest = hn::Max(nearest, hn::IfThenElseZero(somewhere, p.inverse_z));
    }
    return nearest;
}

// Any vector of pixels.
template <class T, int kChannels>
HWY_INLINE void sample(const SlowRow& row, const Source& source, int x, T* out,
                       std::uint8_t* mask) {
    const IntTag di;
    const RowsTask& task = row.task;
    const Float depth = row.depth(x);
    const Located at = row.locate(x);
    Points p = at.points();
    Mask valid = confine(*task.projector, depth, p);
    Int codes = codes_of(depth, valid);
    const Mask gone = row.gone(x, p, valid);
    codes = hn::IfThenElse(hn::RebindMask(di, gone), code_of(Validity::occluded), codes);
    if (task.hide) valid = hn::AndNot(gone, valid);
    store_codes(codes, mask);
    if (hn::AllFalse(FloatTag(), valid)) std::fill_n(out, kLanes * kChannels, T{0});
    else if (task.nearest) sample_nearest<T, kChannels>(source, p, valid, out);
    else sample_bilinear<T, kChannels>(source, at, valid, out);
}

template <class T, int kChannels>
void register_rows_of(const RowsTask& task, int begin, int end) {
    const int width = task.depth->width();
    const Source source(task.source);
    T pixels[kLanes * kChannels];  // of the last, incomplete vector of a row
    std::uint8_t codes[kLanes];
    const RowOrder order(task, begin, end);
    for (int i = -order.before; i < order.count; ++i) {
        const int y = order.row(i);
        const AnyRow row(*task.projector, y, kHalfBack);
        const DepthRow depth(*task.depth, y, *task.room);
        T* out = reinterpret_cast<T*>(static_cast<char*>(task.registered.data) +
                                      y * task.registered.row_bytes);
        std::uint8_t* mask = task.mask + static_cast<std::size_t>(y) * width;
        int whole = 0;  // up to here all is done by stretches
        double units = 1;
#if HWY_TARGET != HWY_SCALAR
        const UsualRow<T, kChannels> usual(task, source, depth, y, out, mask);
        if (!task.nearest && i >= 0) {
            whole = width / kLanes * kLanes;
            units = usual.units();
        }
#endif
        HiddenRow hidden(task, order.shadows, width, order.before + i, units);
        const SlowRow slow{task, row, depth, hidden};
        Float nearest = hn::Zero(FloatTag());
        if (task.row_grid) nearest = put(slow, hidden, whole, units);
        const auto sample_at = [&](int x) HWY_ATTR {
            const int left = width - x;
            if (left >= kLanes) {
                sample<T, kChannels>(slow, source, x, out + kChannels * x, mask + x);
                return;
            }
            sample<T, kChannels>(slow, source, x, pixels, codes);
            std::copy_n(pixels, kChannels * left, out + kChannels * x);
            std::copy_n(codes, left, mask + x);
        };
        if (whole == 0 && task.row_grid) hidden.find(greatest(nearest));
        if (i < 0) continue;
#if HWY_TARGET != HWY_SCALAR
        if (whole > 0) register_usual(usual, whole, hidden, nearest, sample_at);
#endif
        for (int x = whole; x < width; x += kLanes) sample_at(x);
        if constexpr (std::is_same_v<T, float>)  // while the row is near
            if (!all_finite(out, width * kChannels)) drop_not_finite(out, width, kChannels, mask);
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
    const int width = task.depth->width();
    const Float none = set(std::numeric_limits<double>::quiet_NaN());
    const RowOrder order(task, begin, end);
    for (int i = -order.before; i < order.count; ++i) {
        const int y = order.row(i);
        const AnyRow row(*task.projector, y, kHalfBack);
        const DepthRow depth(*task.depth, y, *task.room);
        float* out = map + 2 * static_cast<std::size_t>(y) * width;
        HiddenRow hidden(task, order.shadows, width, order.before + i, 1);
        const SlowRow slow{task, row, depth, hidden};
        if (task.row_grid) hidden.find(greatest(put(slow, hidden, 0, 1)));
        if (i < 0) continue;
        for (int x = 0; x < width; x += kLanes) {
            HWY_ALIGN float u[kLanes], v[kLanes];
            Points p = slow.locate(x).points();
            Mask valid = confine(*task.projector, slow.depth(x), p);
            if (task.hide) valid = hn::AndNot(slow.gone(x, p, valid), valid);
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

HWY_EXPORT(register_rows);
HWY_EXPORT(map_rows);

}  // namespace

void HiddenRoom::keep(int width, const RowGrid& grid) {
    constexpr int kRoom = 128;  // two vectors more, whatever their length
    stride = (width + kRoom) / 64 * 64;
    for (auto* row : {&place, &inverse_z, &low, &high, &before, &behind}) row->keep(kRows * stride);
    for (auto* row : {&breaks, &written}) row->keep(kRows * stride);
    across.keep(stride);
    passed.keep(stride);
    cells.keep(kRows * grid.room());
}

void register_rows(const RowsTask& task, int begin, int end) {
    HWY_DYNAMIC_DISPATCH(register_rows)(task, begin, end);
}

void map_rows(const RowsTask& task, int begin, int end, float* out) {
    HWY_DYNAMIC_DISPATCH(map_rows)(task, begin, end, out);
}

}  // namespace xcalib
#endif

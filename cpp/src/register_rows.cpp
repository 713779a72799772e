#include "register_rows.hpp"

#include <algorithm>
#include <cstring>
#include <limits>

#include "kernel_targets.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "register_rows.cpp"
#include <hwy/foreach_target.h>

#include "project-inl.hpp"
#include "sample-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace xcalib {
namespace HWY_NAMESPACE {
namespace {

// Any vector of pixels.
template <class T, int kChannels>
HWY_INLINE void sample(const RowsTask& task, const Source& source, const Row& row, Float depth,
                       Float x, T* out, std::uint8_t* mask) {
    const IntTag di;
    const Located at = locate(row, depth, x);
    Points p = at.points();
    Mask valid = confine(*task.reprojection, depth, p);
    Int codes = hn::IfThenElse(hn::RebindMask(di, is_depth(depth)), code_of(Validity::outside),
                               code_of(Validity::no_depth));
    codes = hn::IfThenZeroElse(hn::RebindMask(di, valid), codes);
    if (task.cells) {
        const Mask gone = hn::And(valid, hidden(*task.grid, task.cells, p));
        codes = hn::IfThenElse(hn::RebindMask(di, gone), code_of(Validity::occluded), codes);
        if (task.hide) valid = hn::AndNot(gone, valid);
    }
    store_codes(codes, mask);
    if (hn::AllFalse(FloatTag(), valid)) std::fill_n(out, kLanes * kChannels, T{0});
    else if (task.nearest) sample_nearest<T, kChannels>(source, p, valid, out);
    else sample_bilinear<T, kChannels>(source, at, valid, out);
}

#if HWY_TARGET != HWY_SCALAR
// A stretch of a row of one channel: what is usual is done in loops of a few steps each, through
// memory. A vector's steps wait for each other, and what waits fills the processor; in short loops,
// other vectors' steps come in between.
using Vectors = std::uint64_t;  // one bit for each
constexpr int kVectors = 64;

struct Stretch {
    // Of the pixel left of and above the point, shifted by kLarge, and how far it is from there.
    HWY_ALIGN float x[kVectors * kLanes], y[kVectors * kLanes];
    HWY_ALIGN float a[kVectors * kLanes], b[kVectors * kLanes];
    HWY_ALIGN float inverse_z[kVectors * kLanes];
    int from[kVectors], upper[kVectors];  // each vector's window
};

// That which is far outside may overflow.
HWY_INLINE int whole_of(float shifted) {
    std::uint32_t bits;
    std::memcpy(&bits, &shifted, sizeof bits);
    return static_cast<int>(bits - kLargeBits);
}

// Where `count` vectors lie, from pixel `begin` of row y on.
HWY_INLINE void locate(const RowsTask& task, const Row& row, const DepthRow& depths, int y,
                       int begin, int count, Stretch& stretch) {
    const FloatTag d;
    const Float least = hn::Set(d, least_depth(*task.reprojection, y, task.depth.view.width));
    Float along = hn::Add(hn::Iota(d, 0.0f), set(double(begin)));
    for (int i = 0; i < count * kLanes; i += kLanes) {
        const Float depth = depths.load(begin + i);
        depths.prefetch_next_row(begin + i);
        const Located at = locate(row, depth, along);
        // Elsewhere it is far outside.
        hn::Store(hn::IfThenElseZero(hn::Gt(depth, least), at.x), d, stretch.x + i);
        hn::Store(at.y, d, stretch.y + i);
        hn::Store(at.a, d, stretch.a + i);
        hn::Store(at.b, d, stretch.b + i);
        if (task.cells) hn::Store(at.inverse_z, d, stretch.inverse_z + i);
        along = hn::Add(along, set(double{kLanes}));
    }
}

// The vectors of which a point is hidden.
HWY_INLINE Vectors find_hidden(const RowsTask& task, int count, const Stretch& stretch) {
    const FloatTag d;
    Vectors hidden_ones = 0;
    for (int i = 0; i < count; ++i) {
        const int k = i * kLanes;
        const Located at{hn::Load(d, stretch.x + k),
                         hn::Load(d, stretch.y + k),
                         hn::Load(d, stretch.a + k),
                         hn::Load(d, stretch.b + k),
                         hn::Zero(d),
                         hn::Load(d, stretch.inverse_z + k)};
        hidden_ones |= Vectors{!hn::AllFalse(d, hidden(*task.grid, task.cells, at.points()))} << i;
    }
    return hidden_ones;
}

// Samples the vectors of which all points lie between the same two rows of the source, and within a
// window of them. Returns which do not; of these nothing that is written counts, so that nothing
// waits for a branch. The source must be wider than the window.
template <class T>
HWY_INLINE Vectors sample_windows(const Source& source, int count, Stretch& stretch, T* out,
                                  std::uint8_t* mask) {
    const FloatTag d;
    const IntTag di;
    for (int i = 0; i < count; ++i) {  // within the source, whatever the points are
        stretch.from[i] = window_from<T>(source, whole_of(stretch.x[i * kLanes]));
        stretch.upper[i] = std::clamp(whole_of(stretch.y[i * kLanes]), 0, source.height - 2);
    }
    Vectors others = 0;
    for (int i = 0; i < count; ++i) {
        const int k = i * kLanes, from = stretch.from[i], upper = stretch.upper[i];
        const Int x = hn::BitCast(di, hn::Load(d, stretch.x + k));
        const Int y = hn::BitCast(di, hn::Load(d, stretch.y + k));
        const Int index = hn::Sub(x, set(from + kLargeBits));
        const Int apart =
            hn::Or(hn::Xor(y, set(upper + kLargeBits)), hn::AndNot(set(window<T>() - 1), index));
        others |= Vectors{!hn::AllTrue(di, hn::Eq(apart, hn::Zero(di)))} << i;
        store(interpolate_in_window<T>(source, from, upper, index, hn::Load(d, stretch.a + k),
                                       hn::Load(d, stretch.b + k)),
              out + k);
        hn::StoreU(hn::Zero(ByteTag()), ByteTag(), mask + k);
    }
    return others;
}
#endif

template <class T, int kChannels>
void register_rows_of(const RowsTask& task, int begin, int end) {
    const int width = task.depth.view.width;
    const Source source(task.source);
    T pixels[kLanes * kChannels];  // of the last, incomplete vector of a row
    std::uint8_t codes[kLanes];
#if HWY_TARGET != HWY_SCALAR
    Stretch stretch;
#endif
    for (int y = begin; y < end; ++y) {
        const Row row(*task.reprojection, y, kHalfBack);
        const DepthRow depth(task.depth, y);
        T* out = reinterpret_cast<T*>(static_cast<char*>(task.registered.data) +
                                      y * task.registered.row_bytes);
        std::uint8_t* mask = task.mask + static_cast<std::size_t>(y) * width;
        const auto sample_at = [&](int x) HWY_ATTR {
            const Float along = hn::Add(hn::Iota(FloatTag(), 0.0f), set(double(x)));
            const int left = width - x;
            if (left >= kLanes) {
                sample<T, kChannels>(task, source, row, depth.load(x), along, out + kChannels * x,
                                     mask + x);
                return;
            }
            sample<T, kChannels>(task, source, row, depth.load(x, left), along, pixels, codes);
            std::copy_n(pixels, kChannels * left, out + kChannels * x);
            std::copy_n(codes, left, mask + x);
        };
        int x = 0;
#if HWY_TARGET != HWY_SCALAR
        if constexpr (kChannels == 1) {
            const bool windows = !task.nearest && source.width > window<T>();
            while (windows && width - x >= kLanes) {
                const int count = std::min(kVectors, (width - x) / kLanes);
                locate(task, row, depth, y, x, count, stretch);
                Vectors left = sample_windows(source, count, stretch, out + x, mask + x);
                if (task.cells) left |= find_hidden(task, count, stretch);
                for (; left; left &= left - 1)
                    sample_at(x +
                              kLanes * static_cast<int>(hwy::Num0BitsBelowLS1Bit_Nonzero64(left)));
                x += count * kLanes;
            }
        }
#endif
        for (; x < width; x += kLanes) sample_at(x);
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
        const Row row(*task.reprojection, y, kHalfBack);
        const DepthRow depth(task.depth, y);
        float* out = map + 2 * static_cast<std::size_t>(y) * width;
        Float along = hn::Iota(d, 0.0f);
        for (int x = 0; x < width; x += kLanes, along = hn::Add(along, set(double{kLanes}))) {
            HWY_ALIGN float u[kLanes], v[kLanes];
            const Float metres = depth.load(x, width - x);
            Points p = locate(row, metres, along).points();
            Mask valid = confine(*task.reprojection, metres, p);
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

HWY_EXPORT(register_rows);
HWY_EXPORT(map_rows);

}  // namespace

void register_rows(const RowsTask& task, int begin, int end) {
    HWY_DYNAMIC_DISPATCH(register_rows)(task, begin, end);
}

void map_rows(const RowsTask& task, int begin, int end, float* out) {
    HWY_DYNAMIC_DISPATCH(map_rows)(task, begin, end, out);
}

}  // namespace xcalib
#endif

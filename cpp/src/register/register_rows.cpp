#include "register/register_rows.hpp"

#include <algorithm>
#include <limits>

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

// Any vector of pixels.
template <class T, int kChannels>
HWY_INLINE void sample(const RowsTask& task, const Source& source, const AnyRow& row, Float depth,
                       Float x, int column, T* out, std::uint8_t* mask) {
    const IntTag di;
    const Located at = locate(row, depth, x, column);
    Points p = at.points();
    Mask valid = confine(*task.projector, depth, p);
    Int codes = codes_of(depth, valid);
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
#if HWY_TARGET != HWY_SCALAR
        const Reach reach = reach_of<T>(source, task.projector->step_along_row(width / 2, y));
#endif
        const AnyRow row(*task.projector, y, kHalfBack);
        const DepthRow depth(task.depth, y);
        T* out = reinterpret_cast<T*>(static_cast<char*>(task.registered.data) +
                                      y * task.registered.row_bytes);
        std::uint8_t* mask = task.mask + static_cast<std::size_t>(y) * width;
        const auto sample_at = [&](int x) HWY_ATTR {
            const Float along = hn::Add(hn::Iota(FloatTag(), 0.0f), set(double(x)));
            const int left = width - x;
            if (left >= kLanes) {
                sample<T, kChannels>(task, source, row, depth.load(x), along, x,
                                     out + kChannels * x, mask + x);
                return;
            }
            sample<T, kChannels>(task, source, row, depth.load(x, left), along, x, pixels, codes);
            std::copy_n(pixels, kChannels * left, out + kChannels * x);
            std::copy_n(codes, left, mask + x);
        };
        int x = 0;
#if HWY_TARGET != HWY_SCALAR
        const RowPair rows(*task.projector, y);
        while (!task.nearest && width - x >= kLanes) {
            const int count = std::min(kVectors, (width - x) / kLanes);
            Vectors left =
                register_stretch<T, kChannels>(task, source, reach, rows, depth, y, x, count,
                                               out + kChannels * x, mask + x, stretch);
            for (; left; left &= left - 1) sample_at(x + kLanes * first_of(left));
            x += count * kLanes;
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
        const AnyRow row(*task.projector, y, kHalfBack);
        const DepthRow depth(task.depth, y);
        float* out = map + 2 * static_cast<std::size_t>(y) * width;
        Float along = hn::Iota(d, 0.0f);
        for (int x = 0; x < width; x += kLanes, along = hn::Add(along, set(double{kLanes}))) {
            HWY_ALIGN float u[kLanes], v[kLanes];
            const Float metres = depth.load(x, width - x);
            Points p = locate(row, metres, along, x).points();
            Mask valid = confine(*task.projector, metres, p);
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

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
using Vectors = std::uint32_t;  // one bit for each
constexpr int kVectors = 16;

struct UsualVector {
    // As in Located, and in Cells.
    HWY_ALIGN float x[kLanes], y[kLanes], a[kLanes], b[kLanes];
    HWY_ALIGN float cell_x[kLanes], cell_y[kLanes], inverse_z[kLanes];
    int from, upper;  // its window of the source
    int first_cell;
};
using Stretch = UsualVector[kVectors];

// That which is far outside may overflow.
HWY_INLINE int whole_of(float shifted) {
    std::uint32_t bits;
    std::memcpy(&bits, &shifted, sizeof bits);
    return static_cast<int>(bits - kLargeBits);
}

// Where `count` vectors lie, from pixel `begin` of row y on.
HWY_INLINE void locate(const RowsTask& task, const Row& row, const DepthRow& depths, int y,
                       int begin, int count, const char* out, int vector_bytes, Stretch& stretch) {
    const FloatTag d;
    const Float least = hn::Set(d, least_depth(*task.reprojection, y, task.depth.view.width));
    Float along = hn::Add(hn::Iota(d, 0.0f), set(double(begin)));
    for (int i = 0; i < count; ++i) {
        UsualVector& vector = stretch[i];
        const int x = begin + i * kLanes;
        const Float depth = depths.load(x);
        depths.prefetch_next_row(x);
        __builtin_prefetch(out + i * vector_bytes, 1);  // to be written
        const Located at = locate(row, depth, along);
        // Elsewhere it is far outside.
        hn::Store(hn::IfThenElseZero(hn::Gt(depth, least), at.x), d, vector.x);
        hn::Store(at.y, d, vector.y);
        hn::Store(at.a, d, vector.a);
        hn::Store(at.b, d, vector.b);
        if (task.cells) {
            const Cells cells(*task.grid, at.points());
            hn::Store(cells.x, d, vector.cell_x);
            hn::Store(cells.y, d, vector.cell_y);
            hn::Store(at.inverse_z, d, vector.inverse_z);
        }
        along = hn::Add(along, set(double{kLanes}));
    }
}

// Marks what is hidden. Returns the vectors of which not all cells are close to each other, and
// those that hold something to be 0.
HWY_INLINE Vectors mark_hidden(const RowsTask& task, int count, Stretch& stretch,
                               std::uint8_t* mask) {
    const FloatTag d;
    const IntTag di;
    const hn::Repartition<Nearness, IntTag> pairs;
    const CellGrid& grid = *task.grid;
    constexpr int kWindow = 2 * kLanes, kBefore = kWindow / 8;
    for (int i = 0; i < count; ++i)
        stretch[i].first_cell =
            std::clamp(whole_of(stretch[i].cell_x[0]), kBefore, grid.width) - kBefore;
    Vectors others = 0;
    for (int i = 0; i < count; ++i) {
        const UsualVector& vector = stretch[i];
        const int first = vector.first_cell;
        const int row = std::clamp(whole_of(vector.cell_y[0]), 0, grid.height - 1);
        const Int x = hn::BitCast(di, hn::Load(d, vector.cell_x));
        const Int y = hn::BitCast(di, hn::Load(d, vector.cell_y));
        const Int index = hn::Sub(x, set(first + kLargeBits));
        const Int apart =
            hn::Or(hn::Xor(y, set(row + kLargeBits)), hn::AndNot(set(kWindow - 1), index));
        const Nearness* from = task.cells + row * grid.width + first;
        const auto nearest = hn::Max(hn::LoadU(pairs, from), hn::LoadU(pairs, from + grid.step()));
        const Int both = hn::TableLookupLanes(
            hn::BitCast(di, nearest),
            hn::IndicesFromVec(di, hn::And(hn::ShiftRight<1>(index), set(kLanes - 1))));
        const Int chosen = hn::IfThenElse(hn::TestBit(index, set(1)),
                                          hn::And(both, set(static_cast<int>(0xffff0000))),
                                          hn::ShiftLeft<16>(both));
        const Mask behind = is_behind(grid, hn::BitCast(d, chosen), hn::Load(d, vector.inverse_z));
        const Mask elsewhere = hn::RebindMask(d, hn::Ne(apart, hn::Zero(di)));
        others |= Vectors{!hn::AllFalse(d, elsewhere)} << i;
        if (hn::AllFalse(d, behind)) continue;
        others |= Vectors{task.hide} << i;
        const Mask gone = hn::AndNot(elsewhere, behind);
        store_codes(hn::IfThenElseZero(hn::RebindMask(di, gone), code_of(Validity::occluded)),
                    mask + i * kLanes);
    }
    return others;
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
        stretch[i].from = window_from<T>(source, whole_of(stretch[i].x[0]));
        stretch[i].upper = std::clamp(whole_of(stretch[i].y[0]), 0, source.height - 2);
    }
    Vectors others = 0;
    for (int i = 0; i < count; ++i) {
        const UsualVector& vector = stretch[i];
        const int k = i * kLanes, from = vector.from, upper = vector.upper;
        const Int x = hn::BitCast(di, hn::Load(d, vector.x));
        const Int y = hn::BitCast(di, hn::Load(d, vector.y));
        const Int index = hn::Sub(x, set(from + kLargeBits));
        const Int apart =
            hn::Or(hn::Xor(y, set(upper + kLargeBits)), hn::AndNot(set(window<T>() - 1), index));
        others |= Vectors{!hn::AllTrue(di, hn::Eq(apart, hn::Zero(di)))} << i;
        store(interpolate_in_window<T>(source, from, upper, index, hn::Load(d, vector.a),
                                       hn::Load(d, vector.b)),
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
                locate(task, row, depth, y, x, count, reinterpret_cast<const char*>(out + x),
                       int{sizeof(T)} * kLanes, stretch);
                Vectors left = sample_windows(source, count, stretch, out + x, mask + x);
                if (task.cells) left |= mark_hidden(task, count, stretch, mask + x);
                for (; left; left &= left - 1)
                    sample_at(x +
                              kLanes * static_cast<int>(hwy::Num0BitsBelowLS1Bit_Nonzero32(left)));
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

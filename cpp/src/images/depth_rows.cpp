#include "images/depth_rows.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "base/kernel_targets.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "images/depth_rows.cpp"
#include <hwy/foreach_target.h>
// After it.
#include "base/vectors-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace xcalib {
namespace HWY_NAMESPACE {
namespace {

// Beyond these an inverse is no normal number: what lies there counts as these. [m]
constexpr float kMinDepth = 1e-37f, kMaxDepth = 1e37f;
// Farther than anything, where nothing is known. [1/m]
constexpr float kUnknown = std::numeric_limits<float>::max();

// 1/m, and 0 for what is no depth.
HWY_INLINE Float inverse_of(Float metres) {
    const Mask known = hn::And(hn::Gt(metres, hn::Zero(FloatTag())),
                               hn::Le(metres, set(std::numeric_limits<float>::max())));
    const Float held = hn::Min(hn::Max(metres, set(double{kMinDepth})), set(double{kMaxDepth}));
    return hn::IfThenElseZero(known, reciprocal<true>(held));
}

// Pixels from (x, y) on, in 1/m, and 0 past the end of the row.
HWY_INLINE Float inverse_at(const DepthView& depth, int x, int y) {
    const int left = depth.view.width - x;
    if (depth.view.type == PixelType::f32)
        return inverse_of(load(depth.view.row<float>(y) + x, left));
    const hn::Rebind<std::uint16_t, FloatTag> shorts;
    HWY_ALIGN std::uint16_t room[kLanes] = {};
    const std::uint16_t* from = depth.view.row<std::uint16_t>(y) + x;
    if (left < kLanes) from = std::copy_n(from, left, room) - left;
    const Int units = hn::PromoteTo(IntTag(), hn::LoadU(shorts, from));
    return inverse_of(hn::Mul(hn::ConvertTo(FloatTag(), units), hn::Set(FloatTag(), depth.scale)));
}

// -- Growing -------------------------------------------------------------------------------------

void invert(const DepthView& depth, int y, float* out) {
    const int width = depth.view.width;
    int x = 0;
    if (depth.view.type == PixelType::f32)
        for (const float* from = depth.view.row<float>(y); x <= width - kLanes; x += kLanes)
            hn::StoreU(inverse_of(load(from + x)), FloatTag(), out + x);
    for (; x < width; x += kLanes) hn::StoreU(inverse_at(depth, x, y), FloatTag(), out + x);
    out[width] = out[width - 1];  // the right neighbour of the last column
}

// Where two rows of inverse depth are of one surface, a bit for each column: it, its right
// neighbour and those below are known, and of about the same depth.
void compare(const float* upper, const float* lower, int width, std::uint64_t* smooth) {
    const FloatTag d;
    const Float same = hn::Set(d, DepthRows::kSameSurface);
    std::uint8_t bits[8] = {};  // of a mask
    for (int begin = 0; begin <= width; begin += 64) {
        std::uint64_t word = 0;
        for (int i = 0; i < 64; i += kLanes) {
            const int x = begin + i;
            const Float a = load(upper + x), b = load(upper + x + 1);
            const Float c = load(lower + x), e = load(lower + x + 1);
            const Float most = hn::Max(hn::Max(a, b), hn::Max(c, e));
            const Float least = hn::Min(hn::Min(a, b), hn::Min(c, e));
            const Mask one =
                hn::And(hn::Le(most, hn::Mul(least, same)), hn::Gt(least, hn::Zero(d)));
            hn::StoreMaskBits(d, one, bits);
            std::uint64_t some = 0;
            std::memcpy(&some, bits, sizeof some);
            word |= some << i;
        }
        smooth[begin / 64] = word;
    }
}

// Are columns [first, last] all set?
constexpr int kMaxTested = 57;  // columns that a word has, whichever of a byte is the first
HWY_INLINE bool all_smooth(const std::uint64_t* smooth, int first, int last) {
    std::uint64_t word;
    std::memcpy(&word, reinterpret_cast<const char*>(smooth) + first / 8, sizeof word);
    const std::uint64_t wanted = (std::uint64_t{2} << (last - first)) - 1;
    return (~(word >> (first % 8)) & wanted) == 0;
}

// A column and its right neighbour, of a vector of columns.
struct Neighbours {
    Float left, right;
};
template <bool narrow>
HWY_INLINE Neighbours look_up(const float* row, const std::int32_t* left) {
    const FloatTag d;
    if constexpr (narrow) {
        const auto lanes = hn::IndicesFromVec(d, hn::Sub(hn::LoadU(IntTag(), left), set(left[0])));
        const float* from = row + left[0];
        return {hn::TableLookupLanes(load(from), lanes),
                hn::TableLookupLanes(load(from + 1), lanes)};
    }
    HWY_ALIGN float at[kLanes], next[kLanes];
    for (int i = 0; i < kLanes; ++i) {
        at[i] = row[left[i]];
        next[i] = row[left[i] + 1];
    }
    return {hn::Load(d, at), hn::Load(d, next)};
}
HWY_INLINE Float between(const Neighbours& of, Float part) {
    return hn::MulAdd(part, hn::Sub(of.right, of.left), of.left);
}

// A vector of pixels anywhere: on one surface what is between the four around, else the nearest.
template <bool narrow>
HWY_INLINE Float grow_edge(const DepthRows::Pair& pair, const std::int32_t* left, Float along) {
    const FloatTag d;
    const Float same = hn::Set(d, DepthRows::kSameSurface);
    const Neighbours a = look_up<narrow>(pair.upper, left), b = look_up<narrow>(pair.lower, left);
    const Neighbours& near_row = pair.part < 0.5f ? a : b;
    const Float near = hn::IfThenElse(hn::Lt(along, set(0.5)), near_row.left, near_row.right);
    const Float most = hn::Max(hn::Max(a.left, a.right), hn::Max(b.left, b.right));
    const Float least = hn::Min(hn::Min(a.left, a.right), hn::Min(b.left, b.right));
    // Unknown ones are 0: with these there is no one surface, unless all are.
    const Mask one_surface =
        hn::And(hn::Le(most, hn::Mul(near, same)), hn::Ge(hn::Mul(least, same), near));
    const Float mixed = between({between(a, along), between(b, along)}, hn::Set(d, pair.part));
    const Float value = hn::IfThenElse(one_surface, mixed, near);
    return hn::IfThenElseZero(hn::Gt(value, hn::Zero(d)), reciprocal<true>(value));
}

// A row between two. `mixed` has room for one of the caller's. `narrow`: as many columns as a
// vector has come from no more of the caller's.
template <bool narrow>
HWY_INLINE void grow_between(const DepthRows::Pair& pair, int given_width,
                             const DepthRows::Columns& columns, int width,
                             float* HWY_RESTRICT mixed, float* HWY_RESTRICT out) {
    const FloatTag d;
    const Float down = hn::Set(d, pair.part);
    for (int x = 0; x <= given_width; x += kLanes)
        hn::StoreU(between({load(pair.upper + x), load(pair.lower + x)}, down), d, mixed + x);
    const std::int32_t* HWY_RESTRICT left = columns.left.data();
    const float* HWY_RESTRICT part = columns.part.data();
    const std::uint64_t* HWY_RESTRICT smooth = pair.smooth;
    const auto grow_smooth = [=](int x) HWY_ATTR {
        const Float value = between(look_up<narrow>(mixed, left + x), load(part + x));
        hn::StoreU(reciprocal<true>(value), d, out + x);
    };
    // Several vectors at once, where what they come from is: a test and a branch for all of them.
    constexpr int kTogether = 4;
    for (int x = 0; x < width; x += kTogether * kLanes) {
        const int last = left[x + kTogether * kLanes - 1];
        if (HWY_LIKELY(last - left[x] < kMaxTested && all_smooth(smooth, left[x], last))) {
            for (int i = 0; i < kTogether; ++i) grow_smooth(x + i * kLanes);
            continue;
        }
        for (int i = x; i < x + kTogether * kLanes; i += kLanes) {
            if (narrow && all_smooth(smooth, left[i], left[i + kLanes - 1])) grow_smooth(i);
            else hn::StoreU(grow_edge<narrow>(pair, left + i, load(part + i)), d, out + i);
        }
    }
}

void grow(const DepthRows::Pair& pair, int given_width, const DepthRows::Columns& columns,
          int width, float* mixed, float* out) {
    if (given_width <= width) grow_between<true>(pair, given_width, columns, width, mixed, out);
    else grow_between<false>(pair, given_width, columns, width, mixed, out);
}

// -- Reducing ------------------------------------------------------------------------------------

// Rows [top, bottom) of the caller's depth, column by column: of those known the nearest, the
// farthest, their sum [1/m] and their number.
void fold(const DepthView& depth, int top, int bottom, const DepthRows::Fold& out) {
    const FloatTag d;
    const Float zero = hn::Zero(d), one = set(1.0);
    for (int x = 0; x < depth.view.width; x += kLanes) {
        Float most = zero, least = set(double{kUnknown}), sum = zero, count = zero;
        for (int y = top; y < bottom; ++y) {
            const Float inverse = inverse_at(depth, x, y);
            const Mask known = hn::Gt(inverse, zero);
            most = hn::Max(most, inverse);
            least = hn::Min(least, hn::IfThenElse(known, inverse, set(double{kUnknown})));
            sum = hn::Add(sum, inverse);
            count = hn::Add(count, hn::IfThenElseZero(known, one));
        }
        hn::StoreU(most, d, out.most + x);
        hn::StoreU(least, d, out.least + x);
        hn::StoreU(sum, d, out.sum + x);
        hn::StoreU(count, d, out.count + x);
    }
}

// Which columns a vector of pixels is made of: `index` from the first one on.
struct Window {
    int first;
    Int index;
    bool near;  // does it end within two vectors?
};
HWY_INLINE Float look_up(const float* row, const Window& window) {
    const FloatTag d;
    const float* from = row + window.first;
    if (HWY_LIKELY(window.near)) {
        const auto lanes = hn::IndicesFromVec(d, hn::And(window.index, set(kLanes - 1)));
        const Float low = hn::TableLookupLanes(hn::LoadU(d, from), lanes);
        const Float high = hn::TableLookupLanes(hn::LoadU(d, from + kLanes), lanes);
        return hn::IfThenElse(hn::RebindMask(d, hn::Lt(window.index, set(kLanes))), low, high);
    }
    HWY_ALIGN std::int32_t at[kLanes];
    HWY_ALIGN float out[kLanes];
    hn::Store(window.index, IntTag(), at);
    for (int i = 0; i < kLanes; ++i) out[i] = from[at[i]];
    return hn::Load(d, out);
}

// Pixels of columns [left, right) and so many rows. Negative where they are on several surfaces.
void reduce(const DepthRows::Fold& fold, const DepthRows::Columns& columns, int rows, int width,
            float* out) {
    const FloatTag d;
    const Float zero = hn::Zero(d);
    for (int x = 0; x < width; x += kLanes) {
        const std::int32_t *left = columns.left.data() + x, *right = columns.right.data() + x;
        const Int first = hn::LoadU(IntTag(), left), end = hn::LoadU(IntTag(), right);
        const Int last = hn::Sub(end, set(1));
        Float most = zero, least = set(double{kUnknown}), sum = zero, count = zero;
        for (int k = 0; k < columns.widest; ++k) {
            const Int column = hn::Add(first, set(k));
            const Mask in = hn::RebindMask(d, hn::Lt(column, end));
            const Window window{left[0], hn::Sub(hn::Min(column, last), set(left[0])),
                                right[kLanes - 1] - left[0] <= 2 * kLanes};
            // A column twice makes neither more nor less of these.
            most = hn::Max(most, look_up(fold.most, window));
            least = hn::Min(least, look_up(fold.least, window));
            sum = hn::Add(sum, hn::IfThenElseZero(in, look_up(fold.sum, window)));
            count = hn::Add(count, hn::IfThenElseZero(in, look_up(fold.count, window)));
        }
        const Float cells = hn::ConvertTo(d, hn::Mul(hn::Sub(end, first), set(rows)));
        const Mask known = hn::And(hn::Gt(count, zero), hn::Ge(hn::Add(count, count), cells));
        const Mask one_surface = hn::Lt(most, hn::Mul(least, hn::Set(d, DepthRows::kSameSurface)));
        const Float value = hn::IfThenElse(one_surface, hn::Div(count, sum), set(-1.0));
        hn::StoreU(hn::IfThenElseZero(known, value), d, out + x);
    }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace xcalib
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace xcalib {
namespace {

HWY_EXPORT(invert);
HWY_EXPORT(compare);
HWY_EXPORT(grow);
HWY_EXPORT(fold);
HWY_EXPORT(reduce);

float metres_at(const DepthView& depth, int x, int y) {
    if (depth.view.type == PixelType::f32) return depth.view.row<float>(y)[x];
    return depth.scale * static_cast<float>(depth.view.row<std::uint16_t>(y)[x]);
}

bool is_known(float depth) { return depth > 0 && std::isfinite(depth); }

// Caller's pixels [first, end) that make up pixel `i` of the grid: at least one.
struct Span {
    int first, end;

    Span(int i, double step, int size) {
        first = static_cast<int>(std::floor(i * step + 0.5));
        end =
            std::min(size, std::max(first + 1, static_cast<int>(std::floor((i + 1) * step + 0.5))));
    }
};

// Of several surfaces, the one that the median is on.
float depth_of_median(const DepthView& depth, const Span& columns, const Span& rows,
                      std::vector<float>& values) {
    values.clear();
    for (int y = rows.first; y < rows.end; ++y)
        for (int x = columns.first; x < columns.end; ++x)
            if (const float d = metres_at(depth, x, y); is_known(d)) values.push_back(d);
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    const float median = *middle;
    double inverse = 0;
    int members = 0;
    for (const float value : values)
        if (value < median * DepthRows::kSameSurface && value * DepthRows::kSameSurface > median) {
            inverse += 1.0 / value;
            ++members;
        }
    return static_cast<float>(members / inverse);
}

}  // namespace

void DepthRows::set(const DepthView& depth, int width, int height) {
    const bool as_before = depth.view.width == depth_.view.width && width == width_ &&
                           depth.view.height == depth_.view.height && height == height_;
    depth_ = depth;
    width_ = width;
    height_ = height;
    if (as_before || !resizes()) return;
    step_x_ = static_cast<double>(depth.view.width) / width;
    step_y_ = static_cast<double>(depth.view.height) / height;
    columns_.left.keep(width + kBehind);
    columns_.part.keep(width + kBehind);
    columns_.right.keep(width + kBehind);
    columns_.widest = 1;
    for (int i = 0; i < width + kBehind; ++i) {
        const int x = std::min(i, width - 1);
        if (reduces()) {
            const Span span(x, step_x_, depth.view.width);
            columns_.left.data()[i] = span.first;
            columns_.right.data()[i] = span.end;
            columns_.widest = std::max(columns_.widest, span.end - span.first);
            continue;
        }
        const double at = (x + 0.5) * step_x_ - 0.5;
        const int left = std::clamp(static_cast<int>(std::floor(at)), 0, depth.view.width - 1);
        columns_.left.data()[i] = left;
        columns_.part.data()[i] = static_cast<float>(std::clamp(at - left, 0.0, 1.0));
    }
}

void DepthRows::prepare(Room& room) const {
    room.held_[0] = room.held_[1] = room.compared_ = -1;  // those of another frame
    if (!resizes()) return;
    room.row_.keep(width_ + kBehind);
    for (auto& columns : room.columns_) columns.keep(depth_.view.width + 2 * kBehind);
    room.smooth_.keep(depth_.view.width / 64 + 2);
    if (reduces()) {
        const auto most =
            static_cast<std::size_t>(columns_.widest) * (static_cast<int>(step_y_) + 2);
        if (room.values_.capacity() < most) room.values_.reserve(most);
    }
}

const float* DepthRows::inverse_row(int y, Room& room) const {
    float* row = room.columns_[y % 2].data();  // of two neighbours, neither takes the other's place
    if (room.held_[y % 2] != y) HWY_DYNAMIC_DISPATCH(invert)(depth_, y, row);
    room.held_[y % 2] = y;
    return row;
}

const float* DepthRows::grown_row(int y, Room& room) const {
    const double at = (y + 0.5) * step_y_ - 0.5;
    const int last = depth_.view.height - 1;
    const int above = std::clamp(static_cast<int>(std::floor(at)), 0, last);
    Pair pair{inverse_row(above, room), nullptr,
              static_cast<float>(std::clamp(at - above, 0.0, 1.0)), room.smooth_.data()};
    pair.lower = above < last ? inverse_row(above + 1, room) : pair.upper;
    if (room.compared_ != above) HWY_DYNAMIC_DISPATCH(compare)
    (pair.upper, pair.lower, depth_.view.width, room.smooth_.data());
    room.compared_ = above;
    HWY_DYNAMIC_DISPATCH(grow)
    (pair, depth_.view.width, columns_, width_, room.columns_[2].data(), room.row_.data());
    return room.row_.data();
}

const float* DepthRows::row(int y, Room& room) const {
    if (!reduces()) return grown_row(y, room);
    float* out = room.row_.data();
    const Span rows(y, step_y_, depth_.view.height);
    auto& columns = room.columns_;
    const Fold fold{columns[0].data(), columns[1].data(), columns[2].data(), columns[3].data()};
    HWY_DYNAMIC_DISPATCH(fold)(depth_, rows.first, rows.end, fold);
    HWY_DYNAMIC_DISPATCH(reduce)(fold, columns_, rows.end - rows.first, width_, out);
    for (int x = 0; x < width_; ++x)
        if (out[x] < 0)
            out[x] =
                depth_of_median(depth_, Span(x, step_x_, depth_.view.width), rows, room.values_);
    return out;
}

Image resize_depth(const Image& depth, int width, int height) {
    if (width == depth.width && height == depth.height) return depth;
    Image out(width, height);
    DepthRows rows;
    DepthRows::Room room;
    rows.set({depth.view(), 1}, width, height);
    rows.prepare(room);
    for (int y = 0; y < height; ++y) std::copy_n(rows.row(y, room), width, out.row(y));
    return out;
}

}  // namespace xcalib
#endif

// The source at the points of a vector of reference pixels.
// Included once for each instruction set.
#if defined(XCALIB_SAMPLE_INL_) == defined(HWY_TARGET_TOGGLE)
#ifdef XCALIB_SAMPLE_INL_
#undef XCALIB_SAMPLE_INL_
#else
#define XCALIB_SAMPLE_INL_
#endif

#include <algorithm>
#include <cstring>

#include "register/locate-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace xcalib {
namespace HWY_NAMESPACE {
namespace {

// -- The four pixels around a point --------------------------------------------------------------

// 32 bits from each of the byte offsets.
HWY_INLINE Int gather_words(const char* base, Int offsets) {
#if XCALIB_X86_LANES
    return hn::GatherOffset(IntTag(), reinterpret_cast<const std::int32_t*>(base), offsets);
#else  // which others do one by one, and only where aligned
    HWY_ALIGN std::int32_t at[kLanes], words[kLanes];
    hn::Store(offsets, IntTag(), at);
    for (int i = 0; i < kLanes; ++i) std::memcpy(words + i, base + at[i], 4);
    return hn::Load(IntTag(), words);
#endif
}

HWY_INLINE Float gather_floats(const char* base, Int offsets) {
    return hn::BitCast(FloatTag(), gather_words(base, offsets));
}

template <int kByte>
HWY_INLINE Float byte_of(Int words) {
    return hn::ConvertTo(FloatTag(), hn::And(hn::ShiftRight<8 * kByte>(words), set(0xff)));
}
HWY_INLINE Float low_of(Int words) {
    return hn::ConvertTo(FloatTag(), hn::And(words, set(0xffff)));
}
HWY_INLINE Float high_of(Int words) {
    // Shifted as an unsigned number.
    const hn::RebindToUnsigned<IntTag> du;
    return hn::ConvertTo(FloatTag(),
                         hn::BitCast(IntTag(), hn::ShiftRight<16>(hn::BitCast(du, words))));
}

struct Pair {
    Float left, right;
};

// Horizontal neighbours of all channels, from the byte offset of the left one. What is read ends
// with the right one, or, of single bytes, within `last`, the last offset that has four bytes.
HWY_INLINE void gather_pairs(float, const char* base, Int offsets, Int, Pair (&out)[1]) {
#if XCALIB_X86_LANES
    // Eight bytes at once: half as many loads.
    const FloatTag d;
    const hn::RepartitionToWide<IntTag> wide;
    const hn::Half<IntTag> half;
    const auto* words = reinterpret_cast<const std::int64_t*>(base);
    const auto low =
        hn::GatherOffset(wide, words, hn::PromoteTo(wide, hn::LowerHalf(half, offsets)));
    const auto high =
        hn::GatherOffset(wide, words, hn::PromoteTo(wide, hn::UpperHalf(half, offsets)));
    out[0] = {hn::ConcatEven(d, hn::BitCast(d, high), hn::BitCast(d, low)),
              hn::ConcatOdd(d, hn::BitCast(d, high), hn::BitCast(d, low))};
#else
    out[0] = {gather_floats(base, offsets), gather_floats(base + 4, offsets)};
#endif
}
HWY_INLINE void gather_pairs(float, const char* base, Int offsets, Int, Pair (&out)[3]) {
    for (int c = 0; c < 3; ++c)
        out[c] = {gather_floats(base + 4 * c, offsets), gather_floats(base + 4 * c + 12, offsets)};
}
HWY_INLINE void gather_pairs(std::uint16_t, const char* base, Int offsets, Int, Pair (&out)[1]) {
    const Int both = gather_words(base, offsets);
    out[0] = {low_of(both), high_of(both)};
}
HWY_INLINE void gather_pairs(std::uint16_t, const char* base, Int offsets, Int, Pair (&out)[3]) {
    const Int bg = gather_words(base, offsets), rb = gather_words(base + 4, offsets);
    const Int gr = gather_words(base + 8, offsets);
    out[0] = {low_of(bg), high_of(rb)};
    out[1] = {high_of(bg), low_of(gr)};
    out[2] = {low_of(rb), high_of(gr)};
}
HWY_INLINE void gather_pairs(std::uint8_t, const char* base, Int offsets, Int last,
                             Pair (&out)[1]) {
    const hn::RebindToUnsigned<IntTag> du;
    const Int from = hn::Min(offsets, last);
    const Int bits = hn::ShiftLeft<3>(hn::Sub(offsets, from));
    const auto words = hn::BitCast(du, gather_words(base, from));
    const Int both = hn::BitCast(IntTag(), hn::Shr(words, hn::BitCast(du, bits)));
    out[0] = {byte_of<0>(both), byte_of<1>(both)};
}
HWY_INLINE void gather_pairs(std::uint8_t, const char* base, Int offsets, Int, Pair (&out)[3]) {
    const Int bgrb = gather_words(base, offsets), rbgr = gather_words(base + 2, offsets);
    out[0] = {byte_of<0>(bgrb), byte_of<3>(bgrb)};
    out[1] = {byte_of<1>(bgrb), byte_of<2>(rbgr)};
    out[2] = {byte_of<2>(bgrb), byte_of<3>(rbgr)};
}

#if HWY_TARGET != HWY_SCALAR
// The same from one stretch of a row, into which all points fall: neighbours in the reference are
// neighbours in the source, save across a depth edge. A shuffle is far cheaper than a gather.
// `index` is the left pixel's place in the stretch, from 0 to window - 1, a power of two less one;
// of what lies elsewhere something comes out, which does not count. A stretch is one register, or
// two where the source is about as fine as the reference; where it is finer still, none.
enum class Reach { one, two, none };

#undef XCALIB_LOOK_UP_16  // 16 bits of 32
#define XCALIB_LOOK_UP_16 (HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX3)

template <class T, Reach reach>
constexpr int window() {
    if (XCALIB_LOOK_UP_16 && sizeof(T) == 2) return 32;
    return (sizeof(T) == 1 ? 16 : kLanes) * (reach == Reach::two ? 2 : 1);
}
// Where a register holds many pixels, the right neighbours are looked up in the same one, so that
// half as much is loaded: the last pixel of a window has none.
template <class T>
constexpr bool looks_up_both = kLanes >= 16 && sizeof(T) == 4;
template <class T, Reach reach>
constexpr int usable() {
    return window<T, reach>() - (looks_up_both<T> ? 1 : 0);
}
// So many pixels of a window lie before the first of a vector's points.
template <class T, Reach reach>
constexpr int kBefore = window<T, reach>() / 8;

HWY_INLINE Int look_up(Int table, Int index) {
    const IntTag d;
    return hn::TableLookupLanes(table, hn::IndicesFromVec(d, hn::And(index, set(kLanes - 1))));
}
HWY_INLINE Int look_up(Int low, Int high, Int index) {
#if HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX3
    return Int{_mm512_permutex2var_epi32(low.raw, index.raw, high.raw)};
#else
    const auto beyond = hn::TestBit(index, set(kLanes));
    return hn::IfThenElse(beyond, look_up(high, index), look_up(low, index));
#endif
}

template <Reach reach>
HWY_INLINE Pair pair_in_window(const float* row, Int index) {
    const auto found = [](const float* from, Int at) HWY_ATTR {
        const auto part = [from](int i) HWY_ATTR {
            return hn::BitCast(IntTag(), hn::LoadU(FloatTag(), from + i * kLanes));
        };
        if constexpr (reach == Reach::one) return hn::BitCast(FloatTag(), look_up(part(0), at));
        else return hn::BitCast(FloatTag(), look_up(part(0), part(1), at));
    };
    if constexpr (looks_up_both<float>)
        return {found(row, index), found(row, hn::Add(index, set(1)))};
    else return {found(row, index), found(row + 1, index)};
}

template <Reach reach>
HWY_INLINE Pair pair_in_window(const std::uint16_t* row, Int index) {
#if XCALIB_LOOK_UP_16
    const __m512i place = hn::Or(index, hn::ShiftLeft<16>(index)).raw;
    const __m512i left = _mm512_permutexvar_epi16(place, _mm512_loadu_si512(row));
    const Int both{
        _mm512_mask_permutexvar_epi16(left, 0xaaaaaaaau, place, _mm512_loadu_si512(row + 1))};
#else
    const IntTag d;
    const auto load = [d](const std::uint16_t* from) HWY_ATTR {
        const Int left = hn::PromoteTo(d, hn::LoadU(ShortTag(), from));
        const Int right = hn::PromoteTo(d, hn::LoadU(ShortTag(), from + 1));
        return hn::Or(left, hn::ShiftLeft<16>(right));
    };
    const Int both = reach == Reach::one ? look_up(load(row), index)
                                         : look_up(load(row), load(row + kLanes), index);
#endif
    return {low_of(both), high_of(both)};
}

template <Reach reach>
HWY_INLINE Pair pair_in_window(const std::uint8_t* row, Int index) {
    const hn::Repartition<std::uint8_t, IntTag> bytes;
    // A byte's place is below 16, or has its upper bit set, which gives 0: of 32, each register is
    // asked for its own half.
    const auto places = [&](Int at) HWY_ATTR {
        if constexpr (reach == Reach::two) at = hn::Or(at, hn::ShiftLeft<3>(hn::And(at, set(16))));
        return hn::BitCast(bytes, hn::Or(at, set(static_cast<int>(0x80808000))));
    };
    const auto low = places(index), high = places(hn::Xor(index, set(16)));
    const auto in = [&](const std::uint8_t* from) HWY_ATTR {
        auto found = hn::TableLookupBytesOr0(hn::LoadDup128(bytes, from), low);
        if constexpr (reach == Reach::two)
            found = hn::Or(found, hn::TableLookupBytesOr0(hn::LoadDup128(bytes, from + 16), high));
        return hn::ConvertTo(FloatTag(), hn::BitCast(IntTag(), found));
    };
    return {in(row), in(row + 1)};
}
#endif

HWY_INLINE Float between(const Pair& top, const Pair& bottom, Float a, Float b) {
    const Float upper = hn::MulAdd(a, hn::Sub(top.right, top.left), top.left);
    const Float lower = hn::MulAdd(a, hn::Sub(bottom.right, bottom.left), bottom.left);
    return hn::MulAdd(b, hn::Sub(lower, upper), upper);
}

// -- A row of the registered image ---------------------------------------------------------------

HWY_INLINE void store(Float value, float* out) { hn::StoreU(value, FloatTag(), out); }
template <class T>
HWY_INLINE void store(Float value, T* out) {  // a mean of values in range is in range
    const hn::Rebind<T, FloatTag> d;
    hn::StoreU(hn::DemoteTo(d, to_integer(value)), d, out);  // which rounds
}

HWY_INLINE void store_pixels(const Float (&values)[1], float* out) { store(values[0], out); }
template <class T>
HWY_INLINE void store_pixels(const Float (&values)[1], T* out) {
    store(values[0], out);
}
template <class T>
HWY_INLINE void store_pixels(const Float (&values)[3], T* out) {
    HWY_ALIGN T planes[3][kLanes];
    for (int c = 0; c < 3; ++c) store(values[c], planes[c]);
    const hn::Rebind<T, FloatTag> d;
    hn::StoreInterleaved3(hn::Load(d, planes[0]), hn::Load(d, planes[1]), hn::Load(d, planes[2]), d,
                          out);
}

struct Source {
    const char* data;
    std::ptrdiff_t row_bytes;
    int width, height;
    int last;  // byte offset of the last four bytes

    HWY_INLINE explicit Source(const ImageView& view)
        : data(static_cast<const char*>(view.data)), row_bytes(view.row_bytes), width(view.width),
          height(view.height) {
        const std::ptrdiff_t last_row = std::max<std::ptrdiff_t>(0, (height - 1) * row_bytes);
        last = static_cast<int>(last_row) + width - 4;
    }
    template <class T>
    HWY_INLINE const T* at(int x, int y) const {
        return reinterpret_cast<const T*>(data + y * row_bytes) + x;
    }
};

// -- What hides a point ---------------------------------------------------------------------------

// The upper left one of the two cells that a point lies between, shifted by kLarge. A silhouette
// lies anywhere between the last pixel on it and the first beside it: half a cell to both sides,
// along the way that near points move, is searched.
struct Cells {
    Float x, y;

    HWY_INLINE Cells(const CellGrid& grid, const Points& p) {
        const auto below = [](Float pixels, float per_pixel, double reach) HWY_ATTR {
            const Float in_cells = hn::MulAdd(pixels, set(per_pixel), set(-0.5 - reach));
            return hn::Add(hn::Max(in_cells, hn::Zero(FloatTag())), set(kLarge));
        };
        x = below(p.u, grid.per_pixel_x, grid.along_x ? 0.5 : 0.0);
        y = below(p.v, grid.per_pixel_y, grid.along_x ? 0.0 : 0.5);
    }
};

HWY_INLINE Mask is_behind(const CellGrid& grid, Float nearest, Float inverse_z) {
    const Float bound =
        hn::MulAdd(inverse_z, set(1.0f + grid.relative_tolerance), set(grid.absolute_tolerance));
    return hn::Gt(nearest, bound);
}

// What is nearest in the cells of points within the source; anything for others.
HWY_INLINE Float nearest_in(const CellGrid& grid, const Nearness* cells, Float x, Float y) {
    const FloatTag d;
    const hn::RebindToUnsigned<IntTag> du;
    const Float cell = hn::MulAdd(hn::Sub(y, set(kLarge)), set(static_cast<double>(grid.width)),
                                  hn::Sub(x, set(kLarge)));
    const auto last = hn::Set(du, static_cast<std::uint32_t>(grid.count()));
    const Int there = hn::BitCast(IntTag(), hn::Min(hn::BitCast(du, to_integer(cell)), last));
    const auto nearness_at = [&](const Nearness* from) HWY_ATTR {
        const auto* bytes = reinterpret_cast<const char*>(from);
        return hn::BitCast(d, hn::ShiftLeft<16>(gather_words(bytes, hn::ShiftLeft<1>(there))));
    };
    return hn::Max(nearness_at(cells), nearness_at(cells + grid.step()));
}

// Those that something nearer hides, of points within the source; anything of others.
HWY_INLINE Mask hidden(const CellGrid& grid, const Nearness* cells, const Points& p) {
    const Cells at(grid, p);
    return is_behind(grid, nearest_in(grid, cells, at.x, at.y), p.inverse_z);
}

HWY_INLINE Int code_of(Validity code) { return set(static_cast<int>(code)); }
HWY_INLINE void store_codes(Int codes, std::uint8_t* mask) {
    hn::StoreU(hn::DemoteTo(ByteTag(), codes), ByteTag(), mask);
}

// Points between the pixels `x` and `y` of their upper left, by (a, b); 0 where not valid. The last
// cell serves its far edge too, so that all four pixels exist.
struct Places {
    Int x, y;
    Float a, b;

    HWY_INLINE Places(const Source& source, const Located& at, Mask valid) {
        const Float zero = hn::Zero(FloatTag()), one = set(1.0);
        const auto within = [&](Float whole, int size) HWY_ATTR {
            return hn::IfThenElseZero(valid, hn::Min(hn::Max(whole, zero), set(size - 2.0)));
        };
        const auto part = [&](Float part, Float moved) HWY_ATTR {
            return hn::IfThenElseZero(valid, hn::Min(hn::Max(hn::Add(part, moved), zero), one));
        };
        const Float left = within(at.left(), source.width), top = within(at.top(), source.height);
        x = to_integer(left);
        y = to_integer(top);
        a = part(at.a, hn::Sub(at.left(), left));
        b = part(at.b, hn::Sub(at.top(), top));
    }
};

// Between the four pixels of which (x, y) is the upper left.
template <class T, int kChannels>
HWY_INLINE void interpolate_anywhere(const Source& source, Int x, Int y, Float a, Float b,
                                     Float (&values)[kChannels]) {
    const Int stride = set(static_cast<int>(source.row_bytes));
    const Int offsets = hn::Add(hn::Mul(y, stride), hn::Mul(x, set(kChannels * int{sizeof(T)})));
    const Int last = set(source.last);
    Pair top[kChannels], bottom[kChannels];
    gather_pairs(T(), source.data, offsets, last, top);
    gather_pairs(T(), source.data, hn::Add(offsets, stride), last, bottom);
    for (int c = 0; c < kChannels; ++c) values[c] = between(top[c], bottom[c], a, b);
}

#if HWY_TARGET != HWY_SCALAR
// What holds a vector's points, so many source pixels apart, on one surface, of a source wider than
// the window.
template <class T>
HWY_INLINE Reach reach_of(const Source& source, double step) {
    const double needed = (kLanes - 1) * step + 1.5;
    const auto serves = [&](int before, int pixels, int all) {
        return needed + before < pixels && source.width > all;
    };
    constexpr Reach one = Reach::one, two = Reach::two;
    if (serves(kBefore<T, one>, usable<T, one>(), window<T, one>())) return one;
    if (serves(kBefore<T, two>, usable<T, two>(), window<T, two>())) return two;
    return Reach::none;
}

// Not 0 where there is no pixel at `index` of a window, or no right neighbour of it.
template <class T, Reach reach>
HWY_INLINE Int beyond_window(Int index) {
    constexpr int kLast = window<T, reach>() - 1;
    if constexpr (!looks_up_both<T>) return hn::AndNot(set(kLast), index);
    else return hn::AndNot(set(kLast), hn::Or(index, hn::Add(index, set(1))));
}

// In a window that begins at this byte of the source, of points whose left pixels are at `index`.
template <class T, Reach reach>
HWY_INLINE Float interpolate_in_window(const Source& source, int offset, Int index, Float a,
                                       Float b) {
    const char* upper = source.data + offset;
    const char* lower = upper + source.row_bytes;
    return between(pair_in_window<reach>(reinterpret_cast<const T*>(upper), index),
                   pair_in_window<reach>(reinterpret_cast<const T*>(lower), index), a, b);
}

// The same in three rows: where `down`, of the second and third.
template <class T, Reach reach>
HWY_INLINE Float interpolate_in_three(const Source& source, int offset, Int index, Mask down,
                                      Float a, Float b) {
    const auto row = [&](int i) HWY_ATTR {
        const char* from = source.data + offset + i * source.row_bytes;
        return pair_in_window<reach>(reinterpret_cast<const T*>(from), index);
    };
    const auto chosen = [&](const Pair& upper, const Pair& lower) HWY_ATTR {
        return Pair{hn::IfThenElse(down, lower.left, upper.left),
                    hn::IfThenElse(down, lower.right, upper.right)};
    };
    const Pair first = row(0), second = row(1), third = row(2);
    return between(chosen(first, second), chosen(second, third), a, b);
}
#endif

template <class T, int kChannels>
HWY_INLINE void sample_bilinear(const Source& source, const Located& at, Mask valid, T* out) {
    const Places p(source, at, valid);
    Float values[kChannels];
    interpolate_anywhere<T>(source, p.x, p.y, p.a, p.b, values);
    for (Float& value : values) value = hn::IfThenElseZero(valid, value);
    store_pixels(values, out);
}

// The pixel whose centre is next, as it is, so that counts of a radiometric source are never mixed.
template <class T, int kChannels>
HWY_INLINE void sample_nearest(const Source& source, const Points& p, Mask valid, T* out) {
    const IntTag di;
    HWY_ALIGN std::int32_t x[kLanes], y[kLanes], ok[kLanes];
    hn::Store(to_integer(p.u), di, x);
    hn::Store(to_integer(p.v), di, y);
    hn::Store(hn::VecFromMask(di, hn::RebindMask(di, valid)), di, ok);
    for (int i = 0; i < kLanes; ++i)
        for (int c = 0; c < kChannels; ++c)
            out[kChannels * i + c] = ok[i] ? source.at<T>(kChannels * x[i] + c, y[i])[0] : T{0};
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace xcalib
HWY_AFTER_NAMESPACE();

#endif

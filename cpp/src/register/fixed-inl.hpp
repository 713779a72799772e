// Bytes of the source at the points of a vector of reference pixels, in whole
// numbers: places to 1/256 px, all four neighbours of a point in the bytes of
// its lane. For instruction sets that look a byte up in 64 and sum products of
// bytes. Included once for each instruction set.
#if defined(XCALIB_FIXED_INL_) == defined(HWY_TARGET_TOGGLE)
#ifdef XCALIB_FIXED_INL_
#undef XCALIB_FIXED_INL_
#else
#define XCALIB_FIXED_INL_
#endif

#include <algorithm>

#include "register/sample-inl.hpp"

#undef XCALIB_FIXED
#if HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX3_DL
#define XCALIB_FIXED 1
#else
#define XCALIB_FIXED 0
#endif

HWY_BEFORE_NAMESPACE();
namespace xcalib {
namespace HWY_NAMESPACE {
namespace {

// In a row with this shift and these units rounding cuts down to a whole 1/256
// px.
constexpr int kFixedBits = 8;
constexpr double kFixedUnit = 1 << kFixedBits, kFixedShift = kHalfBack / kFixedUnit;

#if XCALIB_FIXED
constexpr int kFixedWindow = 64;

// Pixels of a window, of so many channels.
template <int kChannels>
constexpr int kFixedPixels = kFixedWindow / kChannels;
// So many of them lie before the first of a vector's points.
template <int kChannels>
constexpr int kFixedBefore = kFixedPixels<kChannels> / 8;

template <int kChannels>
HWY_INLINE bool fits_fixed(const Source &source, Reach reach) {
    constexpr int kMaxPixels = 16000;  // beyond, a float does not hold such a number
    const bool near = kChannels == 1 ? reach != Reach::none : reach == Reach::one;
    return near && source.width >= kFixedWindow && source.width <= kMaxPixels &&
           source.height <= kMaxPixels;
}

// Whether all points lie in the window that begins at this offset, between two
// of its rows, or in three rows, `kRows` being 1 or 2. Those that do are
// written to `out`, others are anything. x and y count from the window's first
// pixel. [1/256 px]
template <int kRows, int kChannels>
HWY_INLINE bool interpolate_fixed(const Source &source, int offset, Int x, Int y,
                                  std::uint8_t *out) {
    const __mmask16 inside = _mm512_mask_cmplt_epu32_mask(
        _mm512_cmplt_epu32_mask(x.raw, _mm512_set1_epi32((kFixedPixels<kChannels> - 1) << 8)),
        y.raw, _mm512_set1_epi32(kRows << 8));
    const auto each_lane = [](int four) HWY_ATTR { return _mm512_set1_epi32(four); };
    // Bytes of a lane: left and right above, left and right below.
    const auto spread = [&](Int from_lanes, int byte) HWY_ATTR {
        const __m512i lane = _mm512_set_epi32(0x0c0c0c0c, 0x08080808, 0x04040404, 0, 0x0c0c0c0c,
                                              0x08080808, 0x04040404, 0, 0x0c0c0c0c, 0x08080808,
                                              0x04040404, 0, 0x0c0c0c0c, 0x08080808, 0x04040404, 0);
        return _mm512_shuffle_epi8(from_lanes.raw, _mm512_or_si512(lane, each_lane(byte)));
    };
    __m512i first = spread(x, 0x01010101);
    if constexpr (kChannels == 3) first = _mm512_add_epi8(first, _mm512_add_epi8(first, first));
    // 255 less a byte is the byte with all bits turned. The weights sum up to
    // 255: a place that was cut down to n / 256 is counted as n / 255, which is
    // right in the mean, and where n is 0.
    const __m512i along = _mm512_xor_si512(spread(x, 0), each_lane(0x00ff00ff));
    const __m512i down = _mm512_xor_si512(_mm512_and_si512(spread(y, 0), each_lane(0x00ff00ff)),
                                          each_lane(0x000000ff));
    const char *upper = source.data + offset;
    const __m512i above = _mm512_loadu_si512(upper);
    const __m512i below = _mm512_loadu_si512(upper + source.row_bytes);
    __m512i last = below;
    constexpr __mmask64 kLower = 0xccccccccccccccccull;  // bytes of a lane
    __mmask64 down_a_row = 0;
    if constexpr (kRows == 2) {  // lanes a row further down take both from there
        last = _mm512_loadu_si512(upper + 2 * source.row_bytes);
        down_a_row = _mm512_movepi8_mask(
            _mm512_movm_epi32(_mm512_cmpge_epu32_mask(y.raw, _mm512_set1_epi32(1 << 8))));
    }
    // In the third byte of a lane.
    const auto value = [&](int channel) HWY_ATTR {
        const __m512i place =
            _mm512_add_epi8(first, each_lane(0x01000100 * kChannels + 0x01010101 * channel));
        __m512i four = _mm512_permutexvar_epi8(place, above);
        if constexpr (kRows == 1) {
            four = _mm512_mask_permutexvar_epi8(four, kLower, place, below);
        } else {
            four = _mm512_mask_permutexvar_epi8(four, kLower ^ down_a_row, place, below);
            four = _mm512_mask_permutexvar_epi8(four, kLower & down_a_row, place, last);
        }
        // Signed about 128, so that sums of two fit 16 bits.
        const __m512i rows = _mm512_maddubs_epi16(
            along, _mm512_xor_si512(four, each_lane(static_cast<int>(0x80808080))));
        // 2^16 / 255^2 is 1 + 1/128, to 5e-5. What it starts with is 128.5 so
        // divided.
        constexpr int kStart = static_cast<int>(128.5 * 65536 / (1 + 1.0 / 128));
        const __m512i sum = _mm512_add_epi32(_mm512_madd_epi16(rows, down), each_lane(kStart));
        return _mm512_add_epi32(sum, _mm512_srli_epi32(sum, 7));
    };
    if constexpr (kChannels == 1) {
        const __m512i third = _mm512_set_epi32(0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x3e3a3632,
                                               0x2e2a2622, 0x1e1a1612, 0x0e0a0602);
        _mm_storeu_si128(reinterpret_cast<__m128i *>(out),
                         _mm512_castsi512_si128(_mm512_permutexvar_epi8(third, value(0))));
    } else {  // three bytes of each lane, one after the other
        const auto byte = [&](int i) HWY_ATTR { return each_lane(0xff << (8 * i)); };
        const __m512i pixels = _mm512_or_si512(
            _mm512_or_si512(_mm512_and_si512(_mm512_srli_epi32(value(0), 16), byte(0)),
                            _mm512_and_si512(_mm512_srli_epi32(value(1), 8), byte(1))),
            _mm512_and_si512(value(2), byte(2)));
        const __m512i three = _mm512_set_epi32(
            0, 0, 0, 0, 0x3e3d3c3a, 0x39383635, 0x34323130, 0x2e2d2c2a, 0x29282625, 0x24222120,
            0x1e1d1c1a, 0x19181615, 0x14121110, 0x0e0d0c0a, 0x09080605, 0x04020100);
        const __m512i packed = _mm512_permutexvar_epi8(three, pixels);
        _mm256_storeu_si256(reinterpret_cast<__m256i *>(out), _mm512_castsi512_si256(packed));
        _mm_storeu_si128(reinterpret_cast<__m128i *>(out + 32),
                         _mm512_extracti32x4_epi32(packed, 2));
    }
    return inside == 0xffff;
}
#endif

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace xcalib
HWY_AFTER_NAMESPACE();

#endif

// Vectors of floats, as all kernels use them. Included once for each instruction set.
#if defined(XCALIB_VECTORS_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef XCALIB_VECTORS_INL_HPP
#undef XCALIB_VECTORS_INL_HPP
#else
#define XCALIB_VECTORS_INL_HPP
#endif

#include <hwy/highway.h>

#include <algorithm>

// x86 with eight lanes or more; of Highway's targets, the better has the lower number.
#undef XCALIB_X86_LANES
#if HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX2
#define XCALIB_X86_LANES 1
#else
#define XCALIB_X86_LANES 0
#endif

HWY_BEFORE_NAMESPACE();
namespace xcalib {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
using FloatTag = hn::ScalableTag<float>;
using IntTag = hn::RebindToSigned<FloatTag>;
using Float = hn::Vec<FloatTag>;
using Int = hn::Vec<IntTag>;
using Mask = hn::Mask<FloatTag>;

constexpr int kLanes = static_cast<int>(hn::MaxLanes(FloatTag()));

HWY_INLINE int lanes() { return static_cast<int>(hn::Lanes(FloatTag())); }
HWY_INLINE Float set(double value) { return hn::Set(FloatTag(), static_cast<float>(value)); }
HWY_INLINE Int set(int value) { return hn::Set(IntTag(), value); }
HWY_INLINE Float load(const float* from) { return hn::LoadU(FloatTag(), from); }
// The `left` that there are, 0 past them.
HWY_INLINE Float load(const float* from, int left) {
    if (left >= kLanes) return load(from);
    HWY_ALIGN float room[kLanes] = {};
    std::copy_n(from, left, room);
    return hn::Load(FloatTag(), room);
}
// As many as fit before the end, `left` on.
HWY_INLINE void store(Float value, float* to, int left) {
    if (left >= kLanes) return hn::StoreU(value, FloatTag(), to);
    HWY_ALIGN float room[kLanes];
    hn::Store(value, FloatTag(), room);
    std::copy_n(room, left, to);
}
// 1 / value, to the last bit or so, else to 1e-4.
template <bool exact>
HWY_INLINE Float reciprocal(Float value) {
#if XCALIB_X86_LANES                               // where a division is slow
    Float out = hn::ApproximateReciprocal(value);  // to 12 or, with 16 lanes, 14 bits
    constexpr int steps = (exact ? 1 : 0) + (HWY_TARGET == HWY_AVX2 ? 1 : 0);
    for (int i = 0; i < steps; ++i) out = hn::MulAdd(out, hn::NegMulAdd(value, out, set(1.0)), out);
    return out;
#else
    return hn::Div(set(1.0), value);
#endif
}

HWY_INLINE double total(Float sum) {
    return static_cast<double>(hn::GetLane(hn::SumOfLanes(FloatTag(), sum)));
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace xcalib
HWY_AFTER_NAMESPACE();

#endif

// Vectors of floats, as all kernels use them. Included once for each instruction set.
#if defined(XCALIB_VECTORS_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef XCALIB_VECTORS_INL_HPP
#undef XCALIB_VECTORS_INL_HPP
#else
#define XCALIB_VECTORS_INL_HPP
#endif

#include <hwy/highway.h>

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

HWY_INLINE int lanes() { return static_cast<int>(hn::Lanes(FloatTag())); }
HWY_INLINE Float load(const float* from) { return hn::LoadU(FloatTag(), from); }
HWY_INLINE double total(Float sum) {
    return static_cast<double>(hn::GetLane(hn::SumOfLanes(FloatTag(), sum)));
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace xcalib
HWY_AFTER_NAMESPACE();

#endif

#include "objective/gradient_rows.hpp"

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "base/kernel_targets.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "objective/gradient_rows.cpp"
#include <hwy/foreach_target.h>
// After it.
#include "base/vectors-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace xcalib {
namespace HWY_NAMESPACE {
namespace {

using OneTag = hn::CappedTag<float, 1>;

// Calls work(tag, x) for each vector of pixels in [first, last), the last of them one by one: what
// is beside them may not be read.
template <class Work>
HWY_INLINE void for_each_vector(int first, int last, const Work& work) {
    int x = first;
    for (; x + lanes() <= last; x += lanes()) work(FloatTag(), x);
    for (; x < last; ++x) work(OneTag(), x);
}

template <class D>
struct GradientAt {
    hn::Vec<D> x, y, magnitude;

    HWY_INLINE GradientAt(D d, const ImageRows& rows, int at) {
        const auto half = hn::Set(d, 0.5f);
        const auto difference = [&](const float* from, const float* to) HWY_ATTR {
            return hn::Mul(half, hn::Sub(hn::LoadU(d, to), hn::LoadU(d, from)));
        };
        x = difference(rows.here + at - 1, rows.here + at + 1);
        y = difference(rows.above + at, rows.below + at);
        magnitude = hn::Sqrt(hn::MulAdd(x, x, hn::Mul(y, y)));
    }
};

double sum_of_gradients_here(const ImageRows& rows) {
    Float sum = hn::Zero(FloatTag());
    double rest = 0;
    for_each_vector(1, rows.width - 1, [&](auto d, int x) HWY_ATTR {
        const GradientAt g(d, rows, x);
        if constexpr (std::is_same_v<decltype(d), FloatTag>) sum = hn::Add(sum, g.magnitude);
        else rest += static_cast<double>(hn::GetLane(g.magnitude));
    });
    return total(sum) + rest;
}

void clamped_gradients_here(const ImageRows& rows, float floor, float cap, float* out_x,
                            float* out_y) {
    for_each_vector(1, rows.width - 1, [&](auto d, int x) HWY_ATTR {
        const GradientAt g(d, rows, x);
        const auto zero = hn::Zero(d);
        const auto rise =
            hn::Max(hn::Sub(hn::Min(g.magnitude, hn::Set(d, cap)), hn::Set(d, floor)), zero);
        const auto scale =
            hn::IfThenElseZero(hn::Gt(g.magnitude, zero), hn::Div(rise, g.magnitude));
        hn::StoreU(hn::Mul(g.x, scale), d, out_x + x);
        hn::StoreU(hn::Mul(g.y, scale), d, out_y + x);
    });
}

void doubled_angles_here(const float* x, const float* y, int width, float* out) {
    for_each_vector(0, width, [&](auto d, int i) HWY_ATTR {
        const auto vx = hn::LoadU(d, x + i), vy = hn::LoadU(d, y + i);
        const auto a = hn::Sqrt(hn::MulAdd(vx, vx, hn::Mul(vy, vy)));
        const auto inverse =
            hn::IfThenElseZero(hn::Gt(a, hn::Zero(d)), hn::Div(hn::Set(d, 1.0f), a));
        const auto real = hn::Mul(hn::Mul(hn::Sub(vx, vy), hn::Add(vx, vy)), inverse);
        const auto imaginary = hn::Mul(hn::Mul(hn::Add(vx, vx), vy), inverse);
        hn::StoreInterleaved2(real, imaginary, d, out + 2 * i);
    });
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace xcalib
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace xcalib {
namespace {

HWY_EXPORT(sum_of_gradients_here);
HWY_EXPORT(clamped_gradients_here);
HWY_EXPORT(doubled_angles_here);

}  // namespace

double sum_of_gradients(const ImageRows& rows) {
    return HWY_DYNAMIC_DISPATCH(sum_of_gradients_here)(rows);
}

void clamped_gradients(const ImageRows& rows, float floor, float cap, float* x, float* y) {
    HWY_DYNAMIC_DISPATCH(clamped_gradients_here)(rows, floor, cap, x, y);
}

void doubled_angles(const float* x, const float* y, int width, std::complex<float>* out) {
    HWY_DYNAMIC_DISPATCH(doubled_angles_here)(x, y, width, reinterpret_cast<float*>(out));
}

}  // namespace xcalib
#endif

#include "machine.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "machine.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace xcalib::bench {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr int kChains = 12;

const char* target_name() { return hwy::TargetName(HWY_TARGET); }

void copy_floats(const float* HWY_RESTRICT from, float* HWY_RESTRICT to, std::size_t count) {
    const hn::ScalableTag<float> d;
    const std::size_t lanes = hn::Lanes(d);
    std::size_t i = 0;
    for (; i + lanes <= count; i += lanes) hn::StoreU(hn::LoadU(d, from + i), d, to + i);
    for (; i < count; ++i) to[i] = from[i];
}

float chains(std::size_t rounds) {
    const hn::ScalableTag<float> d;
    // The values tend to 1 and stay normal numbers. Each chain has its own start, so that the
    // compiler cannot merge two.
    const auto factor = hn::Set(d, 0.999f), term = hn::Set(d, 0.001f);
    auto a = hn::Iota(d, 0.0f), b = hn::Iota(d, 1.0f), c = hn::Iota(d, 2.0f);
    auto e = hn::Iota(d, 3.0f), f = hn::Iota(d, 4.0f), g = hn::Iota(d, 5.0f);
    auto h = hn::Iota(d, 6.0f), i = hn::Iota(d, 7.0f), j = hn::Iota(d, 8.0f);
    auto k = hn::Iota(d, 9.0f), l = hn::Iota(d, 10.0f), m = hn::Iota(d, 11.0f);
    for (std::size_t n = 0; n < rounds; ++n) {
        a = hn::MulAdd(a, factor, term), b = hn::MulAdd(b, factor, term);
        c = hn::MulAdd(c, factor, term), e = hn::MulAdd(e, factor, term);
        f = hn::MulAdd(f, factor, term), g = hn::MulAdd(g, factor, term);
        h = hn::MulAdd(h, factor, term), i = hn::MulAdd(i, factor, term);
        j = hn::MulAdd(j, factor, term), k = hn::MulAdd(k, factor, term);
        l = hn::MulAdd(l, factor, term), m = hn::MulAdd(m, factor, term);
    }
    const auto sum = hn::Add(
        hn::Add(hn::Add(a, b), hn::Add(c, e)),
        hn::Add(hn::Add(hn::Add(f, g), hn::Add(h, i)), hn::Add(hn::Add(j, k), hn::Add(l, m))));
    return hn::GetLane(hn::SumOfLanes(d, sum));
}

double flops() { return 2.0 * kChains * static_cast<double>(hn::Lanes(hn::ScalableTag<float>())); }

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace xcalib::bench
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace xcalib::bench {

HWY_EXPORT(target_name);
HWY_EXPORT(copy_floats);
HWY_EXPORT(chains);
HWY_EXPORT(flops);

const char* highway_target() { return HWY_DYNAMIC_DISPATCH(target_name)(); }
void copy(const float* from, float* to, std::size_t count) {
    HWY_DYNAMIC_DISPATCH(copy_floats)(from, to, count);
}
float multiply_add(std::size_t rounds) { return HWY_DYNAMIC_DISPATCH(chains)(rounds); }
double flops_per_round() { return HWY_DYNAMIC_DISPATCH(flops)(); }

}  // namespace xcalib::bench
#endif

#include "objective/correlate_patches.hpp"

#include <vector>

#include "base/kernel_targets.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "objective/correlate_patches.cpp"
#include <hwy/foreach_target.h>
// After it.
#include "base/vectors-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace xcalib {
namespace HWY_NAMESPACE {
namespace {

static_assert(hn::MaxLanes(FloatTag()) <= kShiftsAtOnce);

constexpr int kKinds = 4;  // of sums: a . b, |a|^2 m, |b|^2 m, both weights

// Sums over one cell at as many shifts as kVectors vectors have lanes; of each kind `pitch` floats.
template <int kVectors>
HWY_INLINE void sum_cell(const EdgeRows& a, const EdgeRows& b, int step, int pitch, float* sums) {
    const FloatTag d;
    Float cross[kVectors], a_energy[kVectors], b_energy[kVectors], both[kVectors];
    for (int v = 0; v < kVectors; ++v) cross[v] = a_energy[v] = b_energy[v] = both[v] = hn::Zero(d);
    for (int y = 0; y < step; ++y)
        for (int x = 0; x < step; ++x) {
            const std::size_t i = y * a.stride + x, j = y * b.stride + x;
            const Float ax = hn::Set(d, a.x[i]), ay = hn::Set(d, a.y[i]);
            const Float square = hn::Set(d, a.square[i]), weight = hn::Set(d, a.weight[i]);
            for (int v = 0; v < kVectors; ++v) {
                const std::size_t at = j + v * lanes();
                const Float b_weight = load(b.weight + at);
                cross[v] = hn::MulAdd(ax, load(b.x + at), cross[v]);
                cross[v] = hn::MulAdd(ay, load(b.y + at), cross[v]);
                a_energy[v] = hn::MulAdd(square, b_weight, a_energy[v]);
                b_energy[v] = hn::MulAdd(weight, load(b.square + at), b_energy[v]);
                both[v] = hn::MulAdd(weight, b_weight, both[v]);
            }
        }
    for (int v = 0; v < kVectors; ++v) {
        float* const to = sums + v * lanes();
        hn::StoreU(cross[v], d, to);
        hn::StoreU(a_energy[v], d, to + pitch);
        hn::StoreU(b_energy[v], d, to + 2 * pitch);
        hn::StoreU(both[v], d, to + 3 * pitch);
    }
}

HWY_INLINE EdgeRows from(const EdgeRows& edges, std::size_t offset) {
    return {edges.x + offset, edges.y + offset, edges.square + offset, edges.weight + offset,
            edges.stride};
}

// to[i] = sum_k weights[k] of[i + k stride]; `count` is a multiple of kShiftsAtOnce.
HWY_INLINE void weigh(const float* of, std::size_t stride, const float* weights, int number,
                      std::size_t count, float* to) {
    const FloatTag d;
    for (std::size_t i = 0; i < count; i += lanes()) {
        Float sum = hn::Zero(d);
        for (int k = 0; k < number; ++k)
            sum = hn::MulAdd(hn::Set(d, weights[k]), load(of + i + k * stride), sum);
        hn::StoreU(sum, d, to + i);
    }
}

void correlate_patches_here(const EdgeRows& a, const EdgeRows& b, const PatchGrid& grid, int shifts,
                            float* score) {
    const FloatTag d;
    const int pitch = rounded_up(shifts);
    const int reach = grid.cells / 2, step = grid.step;
    const std::size_t cell = static_cast<std::size_t>(kKinds) * pitch, row = cell * grid.width;
    // Empty cells around the grid are what a patch has beyond the image.
    std::vector<float> cells(cell * (grid.width + 2 * reach));
    std::vector<float> rows(row * (grid.height + 2 * reach));
    for (int y = 0; y < grid.height; ++y) {
        for (int x = 0; x < grid.width; ++x) {
            float* const sums = &cells[(x + reach) * cell];
            const EdgeRows at = from(a, y * step * a.stride + x * step);
            const EdgeRows shifted = from(b, y * step * b.stride + x * step);
            int first = 0;
            for (; first + lanes() < shifts; first += 2 * lanes())
                sum_cell<2>(at, from(shifted, first), step, pitch, sums + first);
            if (first < shifts) sum_cell<1>(at, from(shifted, first), step, pitch, sums + first);
        }
        weigh(cells.data(), cell, grid.profile, grid.cells, row, &rows[(y + reach) * row]);
    }
    std::vector<float> sums(row);
    const Float enough = hn::Set(d, 0.35f * static_cast<float>(step * step));  // of a patch
    const Float least = hn::Set(d, 1e-8f), none = hn::Set(d, kNoCorrelation);
    for (int y = 0; y < grid.height; ++y) {
        weigh(&rows[y * row], row, grid.profile, grid.cells, row, sums.data());
        for (int x = 0; x < grid.width; ++x)
            for (int i = 0; i < pitch; i += lanes(), score += lanes()) {
                const float* const at = &sums[x * cell + i];
                const Float norm = hn::Mul(load(at + pitch), load(at + 2 * pitch));
                const Mask known =
                    hn::And(hn::Gt(load(at + 3 * pitch), enough), hn::Gt(norm, least));
                const Float value = hn::Div(load(at), hn::Sqrt(norm));
                hn::StoreU(hn::IfThenElse(known, value, none), d, score);
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

HWY_EXPORT(correlate_patches_here);

}  // namespace

void correlate_patches(const EdgeRows& a, const EdgeRows& b, const PatchGrid& grid, int shifts,
                       float* score) {
    HWY_DYNAMIC_DISPATCH(correlate_patches_here)(a, b, grid, shifts, score);
}

}  // namespace xcalib
#endif

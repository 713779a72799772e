#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "every_target.hpp"
#include "objective/correlate_patches.hpp"

namespace xcalib {
namespace {

using namespace ::xcalib::testing;  // NOLINT: every_target.hpp

// Random edges of one image, a third of them nothing and some of them not valid.
struct Planes {
    int width, height;
    std::vector<float> x, y, square, weight;

    Planes(int columns, int rows, unsigned seed) : width(columns), height(rows) {
        std::mt19937 random(seed);
        std::uniform_real_distribution<float> edge(-1, 1), share(0, 1);
        for (int i = 0; i < width * height; ++i) {
            const bool valid = i % width > 11 || i / width > 14;
            const bool any = valid && share(random) > 0.3f;
            x.push_back(any ? edge(random) : 0.0f);
            y.push_back(any ? edge(random) : 0.0f);
            square.push_back(x.back() * x.back() + y.back() * y.back());
            weight.push_back(valid ? 0.5f + 0.5f * share(random) : 0.0f);
        }
    }

    EdgeRows from(int column, int row) const {
        const std::size_t i = static_cast<std::size_t>(row) * width + column;
        return {&x[i], &y[i], &square[i], &weight[i], static_cast<std::size_t>(width)};
    }
};

// By its definition, pixel by pixel.
double correlation(const Planes& a, const Planes& b, const PatchGrid& grid, int cell_x, int cell_y,
                   int shift) {
    double cross = 0, a_energy = 0, b_energy = 0, both = 0;
    const int reach = grid.cells / 2;
    for (int v = -reach; v <= reach; ++v)
        for (int u = -reach; u <= reach; ++u) {
            const int column = cell_x + u, row = cell_y + v;
            if (column < 0 || row < 0 || column >= grid.width || row >= grid.height) continue;
            const double w = static_cast<double>(grid.profile[u + reach]) *
                             static_cast<double>(grid.profile[v + reach]);
            for (int y = row * grid.step; y < (row + 1) * grid.step; ++y)
                for (int x = column * grid.step; x < (column + 1) * grid.step; ++x) {
                    const EdgeRows p = a.from(x, y), q = b.from(x + shift, y);
                    cross += w * static_cast<double>(*p.x * *q.x + *p.y * *q.y);
                    a_energy += w * static_cast<double>(*p.square * *q.weight);
                    b_energy += w * static_cast<double>(*q.square * *p.weight);
                    both += w * static_cast<double>(*p.weight * *q.weight);
                }
        }
    const bool known = both > 0.35 * grid.step * grid.step;
    return known ? cross / std::sqrt(a_energy * b_energy) : static_cast<double>(kNoCorrelation);
}

TEST(CorrelatePatches, AreWhatTheirDefinitionSays) {
    const std::vector<float> several{0.25f, 0.5f, 0.25f}, one{1.0f};
    for (const auto& [shifts, cells] : {std::pair{1, 3}, {5, 3}, {16, 1}, {17, 3}, {51, 1}}) {
        SCOPED_TRACE(shifts);
        const PatchGrid grid{6, 5, 5, (cells == 1 ? one : several).data(), cells};
        const int pitch = rounded_up(shifts);
        const Planes a(grid.width * grid.step + 3, grid.height * grid.step + 1, 1);
        const Planes b(grid.width * grid.step + pitch, grid.height * grid.step, 2);
        std::vector<float> score(static_cast<std::size_t>(grid.width) * grid.height * pitch);
        on_every_target([&] {
            correlate_patches(a.from(0, 0), b.from(0, 0), grid, shifts, score.data());
            int known = 0;
            for (int row = 0; row < grid.height; ++row)
                for (int column = 0; column < grid.width; ++column)
                    for (int shift = 0; shift < shifts; ++shift) {
                        const double expected = correlation(a, b, grid, column, row, shift);
                        const float found = score[(row * grid.width + column) * pitch + shift];
                        EXPECT_NEAR(static_cast<double>(found), expected, 1e-5)
                            << column << ", " << row << " at " << shift;
                        known += expected > static_cast<double>(kNoCorrelation);
                    }
            EXPECT_GT(known, grid.width * grid.height * shifts / 2);
            EXPECT_LT(known, grid.width * grid.height * shifts);
        });
    }
}

}  // namespace
}  // namespace xcalib

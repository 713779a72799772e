#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <vector>

#include "refusal.hpp"
#include "xcalib/draw_frames.hpp"

namespace xcalib {
namespace {

using ::xcalib::testing::has;
using ::xcalib::testing::refusal;

TEST(DrawFrames, TakesAllWhereThereAreFew) {
    EXPECT_EQ(draw_frames(0, 32, 1), std::vector<int>{});
    EXPECT_EQ(draw_frames(3, 32, 1), (std::vector<int>{0, 1, 2}));
    EXPECT_EQ(draw_frames(4, 4, 1), (std::vector<int>{0, 1, 2, 3}));
}

TEST(DrawFrames, TakesOneOfEachEqualPartOfTheFootage) {
    for (const auto& [count, chosen] : {std::pair{40, 32}, {1000, 32}, {33, 32}, {7, 2}, {5, 1}})
        for (std::uint32_t seed = 0; seed < 20; ++seed) {
            const std::vector<int> frames = draw_frames(count, chosen, seed);
            ASSERT_EQ(frames.size(), static_cast<std::size_t>(chosen));
            for (int i = 0; i < chosen; ++i) {
                EXPECT_GE(frames[i], static_cast<int>(std::floor(double(count) * i / chosen)));
                EXPECT_LT(frames[i],
                          static_cast<int>(std::floor(double(count) * (i + 1) / chosen)));
            }
            for (int i = 1; i < chosen; ++i) EXPECT_LT(frames[i - 1], frames[i]);  // sorted, unique
        }
}

TEST(DrawFrames, TheSeedDecides) {
    EXPECT_EQ(draw_frames(500, 16, 3), draw_frames(500, 16, 3));
    std::set<std::vector<int>> different;
    for (std::uint32_t seed = 0; seed < 10; ++seed) different.insert(draw_frames(500, 16, seed));
    EXPECT_EQ(different.size(), 10u);
}

TEST(DrawFrames, NonsenseIsRefused) {
    EXPECT_TRUE(has(refusal([] { draw_frames(-1, 4, 0); }), "-1"));
    EXPECT_TRUE(has(refusal([] { draw_frames(10, 0, 0); }), "max_frames = 0"));
}

}  // namespace
}  // namespace xcalib

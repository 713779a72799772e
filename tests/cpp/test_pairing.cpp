#include <gtest/gtest.h>

#include "xcalib/footage/pairing.hpp"

namespace xcalib {
namespace {

using Paths = std::vector<std::filesystem::path>;

TEST(Pairing, NamesAreInTheOrderOfTheirNumbers) {
    EXPECT_EQ(natural_order({"a10", "A2", "a1", "b", "a02"}), (std::vector<int>{2, 1, 4, 0, 3}));
    // Numbers of any length: none is too large.
    EXPECT_EQ(natural_order({"x100000000000000000000000", "x99999999999999999999999"}),
              (std::vector<int>{1, 0}));
}

TEST(Pairing, FilesPairByStemThenByNumbersThenInOrder) {
    EXPECT_EQ(pair_files(Paths{"v/1.png", "v/2.png"}, Paths{"t/2.tiff", "t/1.tiff"}),
              (std::vector<int>{1, 0}));
    EXPECT_EQ(pair_files(Paths{"v/a_07.png", "v/a_8.png"}, Paths{"t/b_8.png", "t/b_7.png"}),
              (std::vector<int>{1, 0}));
    EXPECT_EQ(pair_files(Paths{"v/one.png", "v/two.png"}, Paths{"t/eins.png", "t/zwei.png"}),
              (std::vector<int>{0, 1}));
    EXPECT_THROW(pair_files(Paths{"v/1.png", "v/2.png"}, Paths{"t/1.png", "t/3.png"}), InputError);
    EXPECT_THROW(pair_files(Paths{"v/1.png", "v/1.jpg"}, Paths{"t/1.png", "t/3.png"}), InputError);
}

TEST(Pairing, OnlyTimesSince1970AreTimes) {
    const auto times = times_of_names({"1700000000123", "img_1700000000.5_x"});
    ASSERT_TRUE(times);
    EXPECT_DOUBLE_EQ((*times)[0], 1700000000.123);
    EXPECT_DOUBLE_EQ((*times)[1], 1700000000.5);
    EXPECT_FALSE(times_of_names({"12345678901"}));
    EXPECT_FALSE(times_of_names({"1700000000123_1700000000124"}));
    EXPECT_FALSE(times_of_names({"1700000000123", "1700000000122"}));
}

TEST(Pairing, TablesOfTimes) {
    EXPECT_EQ(times_of_table("name,time\r\n# none\n'a.png', 1.5\nb 2e0\n", "t.csv", {"a", "b"}),
              (std::vector<double>{1.5, 2.0}));
    EXPECT_THROW(times_of_table("a 1\nb x\n", "t.csv", {"a"}), InputError);
    EXPECT_THROW(times_of_table("a 1\n", "t.csv", {"a", "b"}), InputError);
    EXPECT_THROW(times_of_table("a 2\nb 1\n", "t.csv", {"a", "b"}), InputError);
}

TEST(Pairing, TheSlowerStreamChoosesItsNearestOneToOne) {
    const Pairing found = pair_times({0.0, 0.1, 0.2, 0.3, 0.4}, {0.56, 0.71}, 0.5);
    EXPECT_EQ(found.references, (std::vector<int>{1, 2}));
    EXPECT_EQ(found.sources, (std::vector<int>{0, 1}));
    EXPECT_EQ(found.dropped_references, 3);
    EXPECT_EQ(found.dropped_sources, 0);
    EXPECT_NEAR(found.gap, 0.025, 1e-12);
    EXPECT_THROW(pair_times({0.0}, {9.0}), InputError);
}

}  // namespace
}  // namespace xcalib

#include <gtest/gtest.h>

#include "refusal.hpp"
#include "xcalib/footage/sequence.hpp"

namespace xcalib {
namespace {

using testing::has;
using testing::refusal;
using Indices = std::vector<int>;

FrameList named(const std::vector<std::string>& names) {
    FrameList list;
    list.names = names;
    for (const std::string& name : names) list.where.push_back("folder/" + name + ".png");
    return list;
}

FrameList timed(const std::vector<double>& times) {
    FrameList list = named(std::vector<std::string>(times.size(), "frame"));
    list.times = times;
    return list;
}

TEST(Sequence, NamesAreOneWhereOneNumberRisesByOneAsARule) {
    EXPECT_TRUE(clock_of(named({"000000", "000001", "000002"})));
    EXPECT_TRUE(clock_of(named({"cam2_8_T", "cam2_9_T", "cam2_10_T", "cam2_13_T"})));
    EXPECT_FALSE(clock_of(named({"000000"})));
    // Sampled sparsely, as stills from a drive are.
    EXPECT_FALSE(clock_of(named({"000000", "000002", "000004", "000005", "000007"})));
    EXPECT_FALSE(clock_of(named({"1_1", "1_2", "2_3"})));  // which of the two counts?
    EXPECT_FALSE(clock_of(named({"a1", "b2", "c3"})));
    EXPECT_FALSE(clock_of(named({"3", "2", "1"})));
    EXPECT_FALSE(clock_of(named({"left", "right"})));
    EXPECT_FALSE(clock_of(named({"1234567890123456", "1234567890123457"})));
}

TEST(Sequence, TimesAreOneWhereFramesAreNotSecondsApart) {
    const std::optional<FrameClock> clock = clock_of(timed({0, 0.1, 0.2, 0.5}));
    ASSERT_TRUE(clock);
    EXPECT_TRUE(clock->in_seconds);
    EXPECT_DOUBLE_EQ(clock->period, 0.1);
    EXPECT_FALSE(clock_of(timed({0, 5, 10})));
    EXPECT_FALSE(clock_of(timed({1, 1, 1})));
}

TEST(Sequence, LaterFramesAreThoseOfTheClock) {
    const FrameClock numbers = clock_of(named({"1", "2", "3", "5", "6", "7"})).value();
    EXPECT_EQ(frames_later(numbers, {0, 2, 4}, 1), (Indices{1, -1, 5}));
    EXPECT_EQ(frames_later(numbers, {0, 2, 4}, -2), (Indices{-1, 0, -1}));
    EXPECT_EQ(frames_later(numbers, {0, 2}, 0), (Indices{0, 2}));
    // Jitter is borne, half a frame is not.
    const FrameClock times = clock_of(timed({0, 0.1, 0.22, 0.3, 0.45, 0.5})).value();
    EXPECT_EQ(frames_later(times, {0, 1, 3, 5}, 1), (Indices{1, 2, -1, -1}));
}

TEST(Sequence, PairsAreShiftedAndThoseWithoutASourceDropped) {
    Pairing pairing;
    pairing.method = "name";
    pairing.references = {0, 1, 2};
    pairing.sources = {0, 1, 2};
    const FrameList sources = named({"1", "2", "3"});
    const Pairing later = with_lag(pairing, sources, 1);
    EXPECT_EQ(later.references, (Indices{0, 1}));
    EXPECT_EQ(later.sources, (Indices{1, 2}));
    EXPECT_EQ(later.lag, 1);
    EXPECT_EQ(later.dropped_references, 1);
    EXPECT_TRUE(has(later.line(), "source late by +1 of its frames"));
    EXPECT_EQ(with_lag(pairing, named({"a", "b", "c"}), 0).sources, pairing.sources);
    EXPECT_TRUE(has(refusal([&] {
                        with_lag(pairing, named({"a", "b", "c"}), 1);
                    }),
                    "folder/a.png: the source frames are no sequence"));
    EXPECT_TRUE(has(refusal([&] { with_lag(pairing, sources, 3); }), "expected a smaller offset"));
}

TEST(Sequence, AnOffsetIsSecondsOrFramesOrToBeFound) {
    EXPECT_TRUE(parse_time_offset("auto").automatic);
    EXPECT_DOUBLE_EQ(parse_time_offset("-0.25").seconds, -0.25);
    EXPECT_DOUBLE_EQ(parse_time_offset("+1e-1").seconds, 0.1);
    EXPECT_EQ(parse_time_offset("-2f").frames, -2);
    EXPECT_EQ(parse_time_offset("+3f").frames, 3);
    for (const char* bad : {"", "soon", "f", "1.5f", "1 f", "nan", "inf", "1s", "+-1", "+"})
        EXPECT_TRUE(has(refusal([&] { parse_time_offset(bad); }), "--time-offset")) << bad;
    const FrameClock numbers = clock_of(named({"1", "2", "3"})).value();
    EXPECT_EQ(option_for_lag({}, 1, numbers), "--time-offset 1f, or auto");
    EXPECT_EQ(option_for_lag({false, 0.0, 2}, -1, numbers), "--time-offset 1f, or auto");
    const FrameClock times = clock_of(timed({0, 0.1, 0.2})).value();
    EXPECT_EQ(option_for_lag({false, 0.25, 0}, 2, times), "--time-offset 0.4500, or auto");
    EXPECT_EQ(option_for_lag({}, 2, times), "--time-offset 2f, or auto");
}

}  // namespace
}  // namespace xcalib

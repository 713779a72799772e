#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <numeric>
#include <random>
#include <set>
#include <stdexcept>
#include <thread>
#include <vector>

#include "xcalib/stream/stages.hpp"

namespace xcalib {
namespace {

void wait(double milliseconds) {
    std::this_thread::sleep_for(std::chrono::duration<double, std::milli>(milliseconds));
}

// Times that differ from frame to frame, in every run alike.
void unsteady(int frame) {
    wait(std::minstd_rand(static_cast<unsigned>(frame + 1))() % 2000 / 1e3);
}

void nothing(int, const BusyShares&) {}

// What stages were given, from several threads.
class Seen {
   public:
    void add(int frame) {
        const std::lock_guard lock(mutex_);
        frames_.push_back(frame);
    }
    std::vector<int> frames() const { return frames_; }
    std::set<int> set() const { return {frames_.begin(), frames_.end()}; }

   private:
    std::mutex mutex_;
    std::vector<int> frames_;
};

std::vector<int> first(int count) {
    std::vector<int> frames(static_cast<std::size_t>(count));
    std::iota(frames.begin(), frames.end(), 0);
    return frames;
}

class Stages : public ::testing::TestWithParam<int> {};  // threads
INSTANTIATE_TEST_SUITE_P(Threads, Stages, ::testing::Values(1, 4));

TEST_P(Stages, TakeEveryFrameAndInOrderWhereAskedTo) {
    Seen any, ordered, again;
    run_stages(60,
               {{"a", false, [&](int frame, int) { unsteady(frame), any.add(frame); }},
                {"b", true, [&](int frame, int) { unsteady(frame + 7), ordered.add(frame); }},
                {"c", false, [&](int frame, int) { unsteady(frame + 3); }},
                {"d", true, [&](int frame, int) { again.add(frame); }}},
               GetParam(), nothing);
    EXPECT_EQ(any.set().size(), 60u);
    EXPECT_EQ(ordered.frames(), first(60));
    EXPECT_EQ(again.frames(), first(60));
}

TEST(Stages, OfOneThreadAreDoneOneAfterTheOther) {
    std::vector<std::pair<std::string, int>> done;
    const auto note = [&](const char* name) {
        return Stage{name, false,
                     [&done, name](int frame, int) { done.emplace_back(name, frame); }};
    };
    run_stages(3, {note("a"), note("b")}, 1, nothing);
    const std::vector<std::pair<std::string, int>> expected = {{"a", 0}, {"b", 0}, {"a", 1},
                                                               {"b", 1}, {"a", 2}, {"b", 2}};
    EXPECT_EQ(done, expected);
}

TEST(Stages, KeepNoMoreFramesUnderWayThanThreadsEachInASlotOfItsOwn) {
    std::atomic<int> under_way{0}, most{0};
    std::atomic<int> owner[5] = {};
    run_stages(50,
               {{"quick", false,
                 [&](int frame, int slot) {
                     owner[slot] = frame;
                     int now = ++under_way, before = most;
                     while (now > before && !most.compare_exchange_weak(before, now)) {
                     }
                 }},
                {"slow", true,
                 [&](int frame, int slot) {
                     unsteady(frame);
                     EXPECT_EQ(owner[slot], frame);
                     --under_way;
                 }}},
               5, nothing);
    EXPECT_LE(most, 5);
    EXPECT_GT(most, 1);
}

TEST(Stages, WorkAtTheSameTime) {
    // Each waits for the other to have begun with another frame: alone it would wait for ever.
    std::mutex mutex;
    std::condition_variable changed;
    int met[2] = {};
    const auto meet = [&](int which) {
        std::unique_lock lock(mutex);
        ++met[which];
        changed.notify_all();
        return changed.wait_for(lock, std::chrono::seconds(20),
                                [&] { return met[1 - which] >= met[which]; });
    };
    run_stages(10,
               {{"a", true, [&](int frame, int) { EXPECT_TRUE(frame == 0 || meet(0)); }},
                {"b", true, [&](int frame, int) { EXPECT_TRUE(frame == 9 || meet(1)); }}},
               3, nothing);
    EXPECT_EQ(met[0], 9);
}

class BrokenStage : public ::testing::TestWithParam<std::tuple<int, int>> {};  // which, threads
INSTANTIATE_TEST_SUITE_P(All, BrokenStage,
                         ::testing::Combine(::testing::Range(0, 4), ::testing::Values(1, 3)));

TEST_P(BrokenStage, EndsAllButTheFramesBefore) {
    const auto [broken, threads] = GetParam();
    Seen written;
    std::vector<Stage> stages;
    for (int place = 0; place < 4; ++place)
        stages.push_back({"stage", place >= 2, [&, place = place, broken = broken](int frame, int) {
                              unsteady(frame);
                              if (place == broken && frame >= 7)
                                  throw std::out_of_range("frame " + std::to_string(frame));
                              if (place == 3) written.add(frame);
                          }});
    int reported = 0;
    try {
        run_stages(100, stages, threads, [&](int done, const BusyShares&) { reported = done; });
        FAIL();
    } catch (const std::out_of_range& error) {  // with its type
        EXPECT_STREQ(error.what(), "frame 7");
    }
    EXPECT_EQ(written.frames(), first(7));  // all before it, and nothing after it
    EXPECT_EQ(reported, 7);
}

TEST(Stages, TheEarliestFrameNamesTheError) {
    // Frame 1 fails at once, frame 0 late: one by one, frame 0 would have failed.
    try {
        run_stages(10,
                   {{"a", false,
                     [](int frame, int) {
                         wait(frame == 0 ? 50 : 0);
                         throw std::runtime_error(std::to_string(frame));
                     }}},
                   4, nothing);
        FAIL();
    } catch (const std::runtime_error& error) {
        EXPECT_STREQ(error.what(), "0");
    }
}

TEST(Stages, EndWhereTheCallerThrows) {
    Seen started, ended;
    const std::vector<Stage> stages = {
        {"a", false, [&](int frame, int) { started.add(frame), unsteady(frame); }},
        {"b", true, [&](int frame, int) { unsteady(frame), ended.add(frame); }}};
    EXPECT_THROW(run_stages(1000, stages, 3,
                            [](int done, const BusyShares&) {
                                if (done >= 10) throw std::domain_error("enough");
                            }),
                 std::domain_error);
    EXPECT_LT(started.frames().size(), 30u);
    EXPECT_EQ(ended.frames(), first(static_cast<int>(started.frames().size())));  // none half-way
}

TEST(Stages, TellTheCallerWhileNothingIsDone) {
    // Which is how a request to end is seen during one long frame.
    int calls = 0;
    const auto caller = std::this_thread::get_id();
    run_stages(1, {{"slow", false, [](int, int) { wait(350); }}}, 1, [&](int, const BusyShares&) {
        ++calls;
        EXPECT_EQ(std::this_thread::get_id(), caller);
    });
    EXPECT_GE(calls, 3);
}

TEST(Stages, OfNoFrames) {
    int reported = -1;
    run_stages(0, {{"a", true, [](int, int) { FAIL(); }}}, 2,
               [&](int done, const BusyShares&) { reported = done; });
    EXPECT_EQ(reported, 0);
}

TEST(Stages, BusySharesShowWhatTheOthersWaitFor) {
    BusyShares last;
    run_stages(30,
               {{"decode", false, [](int, int) {}},
                {"decode", true, [](int, int) { wait(4); }},
                {"encode", false, [](int, int) { wait(2); }}},
               4, [&](int, const BusyShares& busy) { last = busy; });
    ASSERT_EQ(last.size(), 2u);  // the busiest of one name
    EXPECT_EQ(last[0].first, "decode");
    EXPECT_EQ(last[1].first, "encode");
    EXPECT_LE(last[0].second, 1);
    EXPECT_GT(last[0].second, 2 * last[1].second);
    EXPECT_GT(last[1].second, 0);
}

}  // namespace
}  // namespace xcalib

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdlib>
#include <mutex>
#include <set>
#include <thread>
#include <vector>

#include "base/parallel.hpp"
#include "base/workers.hpp"

namespace xcalib {
namespace {

// Each part once, however many there are and whoever else calls.
void expect_every_part_once(Workers& workers) {
    for (int i = 0; i < 200; ++i) {
        std::vector<int> times(i % 9);
        workers.each(i % 9, [&](int part) { ++times[part]; });
        ASSERT_EQ(times, std::vector<int>(i % 9, 1));
    }
}

TEST(Workers, TakeEveryPartOnce) {
    for (const int count : {1, 2, 3, 8}) {
        Workers workers(count);
        expect_every_part_once(workers);
    }
}

TEST(Workers, MayBeCalledByManyAtOnce) {
    Workers workers(3);
    std::vector<std::thread> callers;
    for (int i = 0; i < 4; ++i) callers.emplace_back([&] { expect_every_part_once(workers); });
    for (std::thread& caller : callers) caller.join();
}

// A forked process has none of the threads, and locks as they were at that moment: right after a
// call, threads that come late hold them.
TEST(Workers, AForkedProcessDoesItAloneAndEnds) {
    for (int i = 0; i < 100; ++i) {
        auto* workers = new Workers(4);
        std::atomic<int> parts{0};
        const auto count = [&](int) { ++parts; };
        workers->each(10, count);
        const pid_t child = fork();
        if (child == 0) {
            alarm(10);
            for (int k = 0; k < 20; ++k) workers->each(10, count);
            delete workers;
            _exit(parts == 210 ? 0 : 1);
        }
        ASSERT_GT(child, 0);
        int status = 0;
        ASSERT_EQ(waitpid(child, &status, 0), child);
        delete workers;
        ASSERT_FALSE(WIFSIGNALED(status)) << "fork " << i << " by signal " << WTERMSIG(status)
                                          << ", of which " << SIGALRM << " is the alarm";
        ASSERT_EQ(WEXITSTATUS(status), 0);
    }
}

// Within a part all is done by the thread that has it, and the caller's before are there again
// after.
TEST(Workers, OfAThreadAreSharedByWhatItDoesInParallel) {
    EXPECT_EQ(WorkersOfThread::here(), nullptr);
    const WorkersOfThread outer(3);
    Workers* const before = WorkersOfThread::here();
    {
        const WorkersOfThread inner(2);
        EXPECT_NE(WorkersOfThread::here(), before);
    }
    EXPECT_EQ(WorkersOfThread::here(), before);
    std::atomic<int> calls{0};
    std::mutex mutex;
    std::set<std::thread::id> threads;
    for (int i = 0; i < 50; ++i)
        parallel_each(20, 3, [&](int) {
            parallel_each(5, 1, [&](int) { ++calls; });
            const std::lock_guard lock(mutex);
            threads.insert(std::this_thread::get_id());
        });
    EXPECT_EQ(calls, 50 * 20 * 5);
    EXPECT_LE(threads.size(), 3u);
    EXPECT_THROW(parallel_each(9, 3,
                               [](int i) {
                                   if (i > 3) throw i;
                               }),
                 int);
    parallel_each(9, 3, [&](int) { parallel_each(4, 3, [&](int) { ++calls; }); });
    EXPECT_EQ(calls, 50 * 20 * 5 + 36);
}

TEST(Workers, AreAsManyAsTheSystemGives) {
#ifdef __SANITIZE_ADDRESS__
    GTEST_SKIP() << "the sanitizer itself takes more memory than the limit";
#endif
    ::testing::GTEST_FLAG(death_test_style) = "threadsafe";
    EXPECT_EXIT(
        {
            rlimit memory{};
            memory.rlim_cur = memory.rlim_max = 1u << 30;  // of stacks for some hundred threads
            setrlimit(RLIMIT_AS, &memory);
            Workers workers(2000);
            expect_every_part_once(workers);
            std::exit(::testing::Test::HasFailure());
        },
        ::testing::ExitedWithCode(0), "");
}

}  // namespace
}  // namespace xcalib

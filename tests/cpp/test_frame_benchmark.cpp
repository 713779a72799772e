#include <gtest/gtest.h>

#include "frame_benchmark.hpp"
#include "refusal.hpp"

namespace xcalib {
namespace {

using ::xcalib::testing::has;
using ::xcalib::testing::refusal;

TEST(FrameBenchmark, EveryStreamRunsAndItsTimesAreInOrder) {
    for (const FrameBenchmark& benchmark : frame_benchmarks(benchmark_rig(97, 64, 40, 32), 10)) {
        const FrameBenchmarkResult result = run_frame_benchmark(benchmark);
        EXPECT_GT(result.median_ms, 0);
        EXPECT_LE(result.median_ms, result.p99_ms);
        EXPECT_LE(result.p99_ms, result.worst_ms);
        EXPECT_GE(result.frames_per_second * result.worst_ms,
                  1000);  // none is slower than the worst
        EXPECT_TRUE(has(to_text(result), "97x64"));
    }
}

TEST(FrameBenchmark, TellsHowManyThreadsAllAre) {
    FrameBenchmark benchmark{benchmark_rig(64, 48, 32, 24)};
    benchmark.frames = 1;
    EXPECT_GE(run_frame_benchmark(benchmark).benchmark.num_threads, 1);
    benchmark.num_threads = 3;
    EXPECT_EQ(run_frame_benchmark(benchmark).benchmark.num_threads, 3);
}

TEST(FrameBenchmark, CountsTheMemoryOfTheOcclusionTest) {
    FrameBenchmark benchmark{benchmark_rig(640, 480, 640, 480)};
    // One camera above the other, where it takes most.
    benchmark.rig.source_from_reference.translation = {0, 0.3, 0};
    benchmark.frames = benchmark.num_threads = 1;
    // Two tables of a cell of two bytes for each pixel, some of whose pages may have been in use.
    EXPECT_GT(run_frame_benchmark(benchmark).resident_kib, 2 * 2 * 300 * 0.9);
}

TEST(FrameBenchmark, RefusesWhatCannotRun) {
    FrameBenchmark benchmark{benchmark_rig(64, 48, 32, 24)};
    benchmark.frames = 0;
    EXPECT_TRUE(has(refusal([&] { run_frame_benchmark(benchmark); }), "frames is 0"));
    benchmark.frames = 1;
    benchmark.channels = 2;
    EXPECT_TRUE(has(refusal([&] { run_frame_benchmark(benchmark); }), "channels is 2"));
    benchmark.channels = 1;
    benchmark.rig.source.fx = -1;
    EXPECT_TRUE(has(refusal([&] { run_frame_benchmark(benchmark); }), "fx = -1"));
}

}  // namespace
}  // namespace xcalib

// How long a frame takes on this machine, and how long at worst: for `xcalib-cli bench`.
#pragma once

#include <string>
#include <vector>

#include "xcalib/register.hpp"

namespace xcalib {

// One stream to time. The frames are rendered: noise for the source, and four depth maps of a road
// with posts that take turns, so that nothing can be kept from the frame before.
struct FrameBenchmark {
    Rig rig;  // whose image sizes count, and whose baseline: without one nothing can be hidden
    PixelType type = PixelType::f32;  // of the source
    int channels = 1;                 // 1 or 3
    bool integer_depth = false;       // uint16 in 1/256 m, instead of float32
    int num_threads = 0;              // 0 uses every core
    Occlusion occlusion = Occlusion::mark;
    int frames = 10000;  // >= 1; some more go before, to warm up
};

struct FrameBenchmarkResult {
    FrameBenchmark benchmark;  // with the number of threads that 0 stands for
    double median_ms = 0;
    double p99_ms = 0;             // of 100 frames, 99 take no longer
    double worst_ms = 0;           // what the machine does besides, included
    double frames_per_second = 0;  // of all frames together
    // What the registrar adds to the process's resident memory, threads included; the caller's
    // images are not. [KiB]
    long resident_kib = 0;
};

// A rig of cameras with these image sizes, side by side, fields of view of 50 and 48 degrees.
Rig benchmark_rig(int width, int height, int source_width, int source_height);

// The streams to compare on one rig: pixel types, with and without the occlusion test, one thread
// and all.
std::vector<FrameBenchmark> frame_benchmarks(const Rig& rig, int frames = 10000);

// Throws std::invalid_argument where the rig or an option is not valid.
FrameBenchmarkResult run_frame_benchmark(const FrameBenchmark& benchmark);

// A plain-text table: its heading, and one line for each result.
std::string frame_benchmark_heading();
std::string to_text(const FrameBenchmarkResult& result);

}  // namespace xcalib

#include "frame_benchmark.hpp"

#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <fstream>
#include <random>
#include <stdexcept>
#include <thread>

#include "base/format.hpp"

namespace xcalib {
namespace {

constexpr int kScenes = 4;
constexpr int kWarmUp = 20;
constexpr double kUnitsPerMetre = 256;

using Bytes = std::vector<char>;

// A road below the horizon, posts on it, 80 m behind; higher and moved from scene to scene.
Image road(const Pinhole& camera, int scene) {
    Image depth(camera.width, camera.height, 80.0f);
    const double horizon = 0.42 * camera.height;
    const auto slope = [&](double y) { return unproject(camera, 0, y, 1).y(); };
    for (int y = 0; y < depth.height; ++y)
        if (y > horizon)
            std::fill_n(depth.row(y), depth.width,
                        static_cast<float>(
                            std::min(80.0, (1.4 + 0.1 * scene) / (slope(y) - slope(horizon)))));
    for (int post = 0; post < 8; ++post) {
        const int left = depth.width * (4 + 12 * post + scene) / 100;
        const int right = std::min(depth.width, left + std::max(1, depth.width * 3 / 100));
        const int bottom = depth.height * (52 + 4 * post) / 100;
        for (int y = depth.height / 5; y < bottom; ++y)
            std::fill(depth.row(y) + left, depth.row(y) + right, 6.0f + 2.0f * post);
    }
    return depth;
}

Bytes depth_pixels(const Image& metres, bool integer) {
    Bytes out(metres.pixels.size() * (integer ? 2 : 4));
    if (!integer) {
        std::memcpy(out.data(), metres.pixels.data(), out.size());
        return out;
    }
    for (std::size_t i = 0; i < metres.pixels.size(); ++i) {
        const auto units =
            static_cast<std::uint16_t>(std::lround(kUnitsPerMetre * metres.pixels[i]));
        std::memcpy(out.data() + 2 * i, &units, 2);
    }
    return out;
}

Bytes noise(std::size_t count, PixelType type) {
    std::mt19937 random(1);
    Bytes out(count * bytes_per_channel(type));
    if (type != PixelType::f32) {
        for (char& byte : out) byte = static_cast<char>(random());
        return out;
    }
    for (std::size_t i = 0; i < count; ++i) {
        const float value = static_cast<float>(random()) / 4294967296.0f;
        std::memcpy(out.data() + 4 * i, &value, 4);
    }
    return out;
}

long resident_kib() {
    malloc_trim(0);  // what is free counts as resident otherwise
    long size = 0, resident = 0;
    std::ifstream("/proc/self/statm") >> size >> resident;
    return resident * (sysconf(_SC_PAGESIZE) / 1024);
}

std::string name_of(const FrameBenchmark& benchmark) {
    const char* const types[] = {"uint8", "uint16", "float32"};
    std::string name = types[static_cast<int>(benchmark.type)];
    if (benchmark.channels == 3) name += " x 3";
    if (benchmark.integer_depth) name += ", uint16 depth";
    return name;
}

}  // namespace

Rig benchmark_rig(int width, int height, int source_width, int source_height) {
    constexpr double kDegree = 3.14159265358979323846 / 180;
    Rig rig{Pinhole::from_hfov(width, height, 50 * kDegree),
            Pinhole::from_hfov(source_width, source_height, 48 * kDegree),
            {}};
    rig.source_from_reference.translation = {-0.13, 0.01, 0.02};
    return rig;
}

std::vector<FrameBenchmark> frame_benchmarks(const Rig& rig, int frames) {
    const int all = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
    std::vector<FrameBenchmark> out;
    for (const int threads : all > 1 ? std::vector<int>{1, all} : std::vector<int>{1}) {
        const auto add = [&](PixelType type, int channels, bool integer_depth, Occlusion test) {
            out.push_back({rig, type, channels, integer_depth, threads, test, frames});
        };
        for (const Occlusion test : {Occlusion::ignore, Occlusion::mark}) {
            add(PixelType::u8, 1, false, test);
            add(PixelType::u16, 1, false, test);
            add(PixelType::f32, 1, false, test);
            add(PixelType::u8, 3, false, test);
            add(PixelType::u16, 1, true, test);
        }
    }
    return out;
}

FrameBenchmarkResult run_frame_benchmark(const FrameBenchmark& benchmark) {
    if (benchmark.frames < 1)
        throw std::invalid_argument("frames is " + std::to_string(benchmark.frames) +
                                    ", expected at least 1");
    if (benchmark.channels != 1 && benchmark.channels != 3)
        throw std::invalid_argument("channels is " + std::to_string(benchmark.channels) +
                                    ", expected 1 or 3");
    benchmark.rig.validate();
    const Pinhole &reference = benchmark.rig.reference, &source = benchmark.rig.source;
    const std::size_t pixels = static_cast<std::size_t>(reference.width) * reference.height;
    const std::size_t pixel_bytes = benchmark.channels * bytes_per_channel(benchmark.type);
    const Bytes image =
        noise(static_cast<std::size_t>(source.width) * source.height * benchmark.channels,
              benchmark.type);
    std::vector<Bytes> depths;
    for (int i = 0; i < kScenes; ++i)
        depths.push_back(depth_pixels(road(reference, i), benchmark.integer_depth));
    Bytes registered(pixels * pixel_bytes, 1);  // written, so that it is resident
    std::vector<std::uint8_t> mask(pixels, 1);
    std::vector<double> times(benchmark.frames, 1);

    RegistrarOptions options;
    options.num_threads = benchmark.num_threads;
    options.occlusion = benchmark.occlusion;
    if (benchmark.integer_depth) options.depth_scale = 1 / kUnitsPerMetre;
    const long before = resident_kib();
    const Registrar registrar(benchmark.rig, options);
    const auto frame = [&](int i) {
        const auto row = [](int width, std::size_t bytes) {
            return static_cast<std::ptrdiff_t>(width * bytes);
        };
        registrar.register_frame(
            {image.data(), source.width, source.height, benchmark.channels, benchmark.type,
             row(source.width, pixel_bytes)},
            {depths[i % kScenes].data(), reference.width, reference.height, 1,
             benchmark.integer_depth ? PixelType::u16 : PixelType::f32,
             row(reference.width, benchmark.integer_depth ? 2 : 4)},
            {registered.data(), reference.width, reference.height, benchmark.channels,
             benchmark.type, row(reference.width, pixel_bytes)},
            mask.data());
    };
    for (int i = 0; i < kWarmUp; ++i) frame(i);

    FrameBenchmarkResult result;
    result.benchmark = benchmark;
    if (benchmark.num_threads == 0)
        result.benchmark.num_threads =
            static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
    result.resident_kib = resident_kib() - before;
    double all = 0;
    for (int i = 0; i < benchmark.frames; ++i) {
        const auto start = std::chrono::steady_clock::now();
        frame(i);
        const std::chrono::duration<double, std::milli> took =
            std::chrono::steady_clock::now() - start;
        times[i] = took.count();
        all += times[i];
    }
    std::sort(times.begin(), times.end());
    result.median_ms = times[times.size() / 2];
    result.p99_ms = times[static_cast<std::size_t>(std::ceil(0.99 * times.size())) - 1];
    result.worst_ms = times.back();
    result.frames_per_second = 1e3 * benchmark.frames / all;
    return result;
}

std::string frame_benchmark_heading() {
    return format("%-9s  %-9s  %-21s  %-9s  %7s  %8s  %8s  %8s  %7s  %8s", "reference", "source",
                  "pixels", "occlusion", "threads", "median", "99 %", "worst", "frames", "memory") +
           "\n" +
           format("%-9s  %-9s  %-21s  %-9s  %7s  %8s  %8s  %8s  %7s  %8s", "[px]", "[px]", "", "",
                  "", "[ms]", "[ms]", "[ms]", "[1/s]", "[KiB]");
}

std::string to_text(const FrameBenchmarkResult& result) {
    const FrameBenchmark& of = result.benchmark;
    const char* const occlusion[] = {"ignore", "mark", "hide"};
    const auto size = [](const Pinhole& camera) {
        return format("%dx%d", camera.width, camera.height);
    };
    return format("%-9s  %-9s  %-21s  %-9s  %7d  %8.3f  %8.3f  %8.3f  %7.0f  %8ld",
                  size(of.rig.reference).c_str(), size(of.rig.source).c_str(), name_of(of).c_str(),
                  occlusion[static_cast<int>(of.occlusion)], of.num_threads, result.median_ms,
                  result.p99_ms, result.worst_ms, result.frames_per_second, result.resident_kib);
}

}  // namespace xcalib

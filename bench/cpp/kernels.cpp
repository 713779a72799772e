// Each kernel alone, one thread, beside a plain copy of as many bytes and the machine's
// multiply-adds. Bytes are those that a kernel must read and write at least: each input and each
// output once. A copy's bytes, too, are what it reads and what it writes.
#include <benchmark/benchmark.h>
#include <ceres/version.h>

#include <cmath>
#include <functional>
#include <memory>
#include <opencv2/core/version.hpp>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "machine.hpp"
#include "objective/nec_pass.hpp"
#include "xcalib/edge_map.hpp"
#include "xcalib/flow.hpp"
#include "xcalib/gray.hpp"
#include "xcalib/nec.hpp"
#include "xcalib/register.hpp"
#include "xcalib/search.hpp"

namespace xcalib::bench {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180;

// Bytes of the kernels: a copy of as many is measured for each.
std::set<std::size_t> copy_sizes;

struct Work {
    std::string name;
    double pixels = 0;  // of the reference, of one call
    double bytes = 0;   // of one call
    std::function<void()> call;
    std::function<double()> edge_share = nullptr;  // share of pixels where the source has an edge
};

void add(const Work& work) {
    copy_sizes.insert(static_cast<std::size_t>(work.bytes));
    benchmark::RegisterBenchmark(work.name.c_str(), [work](benchmark::State& state) {
        for (auto _ : state) work.call();
        state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * work.pixels));
        state.SetBytesProcessed(static_cast<std::int64_t>(state.iterations() * work.bytes));
        state.counters["pixels"] = work.pixels;
        state.counters["bytes"] = work.bytes;
        if (work.edge_share) state.counters["edge_share"] = work.edge_share();
    })->Unit(benchmark::kMillisecond);
}

// -- Images and rigs -----------------------------------------------------------------------------

// Overlapping rectangles, as in a street, blurred a little and with noise.
Image town(unsigned seed, int width, int height) {
    std::mt19937 random(seed);
    const auto uniform = [&random](int low, int high) {
        return low + static_cast<int>(random() % static_cast<unsigned>(high - low));
    };
    Image image(width, height, 0.5f);
    for (int i = 0; i < 300; ++i) {
        const int x = uniform(0, width), y = uniform(0, height);
        const int right = std::min(width, x + uniform(4, width / 6));
        const int bottom = std::min(height, y + uniform(4, height / 6));
        const float gray = static_cast<float>(uniform(0, 256)) / 255.0f;
        for (int v = y; v < bottom; ++v) std::fill(image.row(v) + x, image.row(v) + right, gray);
    }
    image = gaussian_blur(image, 0.8);
    for (float& value : image.pixels)
        value += 0.02f * (static_cast<float>(random() % 1024) / 1024.0f - 0.5f);
    return image;
}

// A road with posts: smooth with steps.
Image road(int width, int height) {
    Image depth(width, height);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const double below = y - 0.42 * height;
            depth.row(y)[x] =
                static_cast<float>(below > 0 ? std::min(80.0, 2.0 * height / below) : 80.0);
            if (x * 8 / width % 2 == 0 && x % (width / 8) < width / 30 && y > height / 5)
                depth.row(y)[x] = std::min(depth.row(y)[x], 8.0f);
        }
    return depth;
}

Rig rig_of(int width, int height, int source_width, int source_height) {
    Rig rig;
    rig.reference = Pinhole::from_hfov(width, height, 50 * kDegree);
    rig.source = Pinhole::from_hfov(source_width, source_height, 48 * kDegree);
    rig.source_from_reference.translation = {-0.13, 0.01, 0.02};
    return rig;
}

// -- The kernels ---------------------------------------------------------------------------------

const char* type_name(PixelType type) {
    return type == PixelType::u8 ? "u8" : type == PixelType::u16 ? "u16" : "f32";
}

// One frame of a stream. The source is random: its values do not matter.
void add_register(PixelType type, int channels, Occlusion occlusion) {
    constexpr int kWidth = 1280, kHeight = 960, kSourceWidth = 640, kSourceHeight = 512;
    struct Stream {
        Registrar registrar;
        Image depth;
        std::vector<std::uint8_t> source, out, mask;
    };
    const auto pixel = static_cast<std::ptrdiff_t>(bytes_per_channel(type)) * channels;
    const Rig rig = rig_of(kWidth, kHeight, kSourceWidth, kSourceHeight);
    const auto stream = std::make_shared<Stream>(
        Stream{Registrar(rig, {1, false, occlusion, 0}), road(kWidth, kHeight),
               std::vector<std::uint8_t>(kSourceWidth * kSourceHeight * pixel),
               std::vector<std::uint8_t>(kWidth * kHeight * pixel),
               std::vector<std::uint8_t>(kWidth * kHeight)});
    std::mt19937 random(1);
    if (type == PixelType::f32) {
        float* values = reinterpret_cast<float*>(stream->source.data());
        for (std::size_t i = 0; i < stream->source.size() / 4; ++i)
            values[i] = static_cast<float>(random() % 256) / 255.0f;
    } else {
        for (std::uint8_t& value : stream->source) value = static_cast<std::uint8_t>(random());
    }
    const std::string name = std::string("register/") + type_name(type) +
                             (channels == 3 ? "x3" : "") +
                             (occlusion == Occlusion::ignore ? "/ignore" : "/mark");
    constexpr double kPixels = kWidth * kHeight;
    const double bytes = kPixels * (4 + 1 + pixel) + kSourceWidth * kSourceHeight * pixel;
    add({name, kPixels, bytes, [=] {
             stream->registrar.register_frame(
                 {stream->source.data(), kSourceWidth, kSourceHeight, channels, type,
                  kSourceWidth * pixel},
                 stream->depth.view(),
                 {stream->out.data(), kWidth, kHeight, channels, type, kWidth * pixel},
                 stream->mask.data());
             benchmark::ClobberMemory();
         }});
}

constexpr int kWidth = 640, kHeight = 480, kSourceHeight = 512;
constexpr double kPixels = kWidth * kHeight, kSourcePixels = kWidth * kSourceHeight;

void add_nec() {
    const Rig rig = rig_of(kWidth, kHeight, kWidth, kSourceHeight);
    const auto frame = std::make_shared<NecFrame>(make_nec_frame(
        town(1, kWidth, kHeight), town(2, kWidth, kSourceHeight), road(kWidth, kHeight), rig));
    // Depth, and the reference's edges in x and y; the source.
    const double bytes = 12 * kPixels + 4 * kSourcePixels;
    const auto edge_share = [=] {
        const auto rows = nec_rows(*frame, rig, Parameters(kNumWithoutReference)).residuals.size();
        return static_cast<double>(rows - 1) / 2 / kPixels;
    };
    add({"nec/value", kPixels, bytes,
         [=] { benchmark::DoNotOptimize(evaluate_nec(*frame, rig).nec); }, edge_share});
    for (const int count : {int{kNumWithoutReference}, int{kNumParameters}})
        add({"nec/normal_equations/" + std::to_string(count), kPixels, bytes,
             [=] {
                 benchmark::DoNotOptimize(
                     nec_normal_equations(*frame, rig, Parameters(count)).gradient.sum());
             },
             edge_share});
}

void add_warp() {
    const Rig rig = rig_of(kWidth, kHeight, kWidth, kSourceHeight);
    const auto source = std::make_shared<Image>(town(2, kWidth, kSourceHeight));
    const auto depth = std::make_shared<Image>(road(kWidth, kHeight));
    add({"warp", kPixels, 9 * kPixels + 4 * kSourcePixels,
         [=] { benchmark::DoNotOptimize(warp(rig, *source, *depth).image.pixels.data()); }});
}

void add_edge_map() {
    const auto image = std::make_shared<Image>(town(1, kWidth, kHeight));
    const EdgeMap map = edge_map(*image);
    add({"edge_map", kPixels, 4 * kPixels + 8.0 * map.width * map.height,
         [=] { benchmark::DoNotOptimize(edge_map(*image).z.data()); }});
}

void add_patch_flow() {
    const auto reference = std::make_shared<Image>(town(1, kWidth, kHeight));
    const FlowField field = patch_flow(*reference, *reference, nullptr, {}, 1);
    add({"patch_flow", kPixels, 8 * kPixels + 12.0 * field.width * field.height, [=] {
             benchmark::DoNotOptimize(patch_flow(*reference, *reference, nullptr, {}, 1).x.data());
         }});
}

// Eight frames, 31 focal lengths, three rolls, one field of view of the reference.
void add_search() {
    constexpr int kFrames = 8;
    const auto references = std::make_shared<std::vector<EdgeMap>>();
    const auto sources = std::make_shared<std::vector<EdgeMap>>();
    for (unsigned i = 0; i < kFrames; ++i) {
        references->push_back(edge_map(town(2 * i, kWidth, kHeight)));
        sources->push_back(edge_map(town(2 * i + 1, kWidth, kSourceHeight)));
    }
    const Rig rig = rig_of(kWidth, kHeight, kWidth, kSourceHeight);
    SearchSpace space;
    SearchHypothesis hypothesis{rig.reference, {}};
    for (int i = -15; i <= 15; ++i)
        hypothesis.sources.push_back(Pinhole::from_hfov(
            kWidth, kSourceHeight, 2 * std::atan(std::pow(1.06, i) * std::tan(24 * kDegree))));
    space.hypotheses = {hypothesis};
    space.rolls = {-4 * kDegree, 0, 4 * kDegree};
    double bytes = 0;
    for (const auto& maps : {*references, *sources})
        for (const EdgeMap& map : maps) bytes += 8.0 * map.width * map.height;
    add({"search", kFrames * kPixels, bytes,
         [=] { benchmark::DoNotOptimize(global_search(*references, *sources, space, 1).data()); }});
}

// -- The machine ---------------------------------------------------------------------------------

void add_copies() {
    copy_sizes.insert(std::size_t{1} << 28);  // what no cache holds
    for (const std::size_t bytes : copy_sizes)
        benchmark::RegisterBenchmark(
            ("copy/" + std::to_string(bytes)).c_str(),
            [bytes](benchmark::State& state) {
                const std::size_t count = bytes / 8;
                const std::vector<float> from(count, 1.0f);
                std::vector<float> to(count);
                for (auto _ : state) {
                    copy(from.data(), to.data(), count);
                    benchmark::ClobberMemory();
                }
                state.SetBytesProcessed(static_cast<std::int64_t>(state.iterations() * 8 * count));
                state.counters["bytes"] = static_cast<double>(8 * count);
            })
            ->Unit(benchmark::kMillisecond);
}

void add_multiply_add() {
    benchmark::RegisterBenchmark("multiply_add", [](benchmark::State& state) {
        constexpr std::size_t kRounds = 100000;
        for (auto _ : state) benchmark::DoNotOptimize(multiply_add(kRounds));
        state.counters["flops"] = benchmark::Counter(
            static_cast<double>(state.iterations()) * kRounds * flops_per_round(),
            benchmark::Counter::kIsRate);
    })->Unit(benchmark::kMillisecond);
}

void add_all() {
    for (const Occlusion occlusion : {Occlusion::ignore, Occlusion::mark})
        for (const PixelType type : {PixelType::f32, PixelType::u8, PixelType::u16})
            for (const int channels : {1, 3}) add_register(type, channels, occlusion);
    add_nec();
    add_warp();
    add_edge_map();
    add_patch_flow();
    add_search();
    add_copies();
    add_multiply_add();
}

void add_context() {
    const auto version = [](int major, int minor, int patch) {
        return std::to_string(major) + "." + std::to_string(minor) + "." + std::to_string(patch);
    };
    benchmark::AddCustomContext("highway_target", highway_target());
#ifdef __clang__
    benchmark::AddCustomContext("compiler", __VERSION__);
#else
    benchmark::AddCustomContext("compiler", "GCC " __VERSION__);
#endif
    benchmark::AddCustomContext(
        "Ceres", version(CERES_VERSION_MAJOR, CERES_VERSION_MINOR, CERES_VERSION_REVISION));
    benchmark::AddCustomContext(
        "Eigen", version(EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION));
    benchmark::AddCustomContext("OpenCV", CV_VERSION);
}

}  // namespace
}  // namespace xcalib::bench

int main(int argc, char** argv) {
    benchmark::Initialize(&argc, argv);
    if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
    xcalib::bench::add_context();
    xcalib::bench::add_all();
    benchmark::RunSpecifiedBenchmarks();
    benchmark::Shutdown();
    return 0;
}

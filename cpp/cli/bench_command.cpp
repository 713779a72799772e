#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "frame_benchmark.hpp"
#include "xcalib/error.hpp"
#include "xcalib/option_words.hpp"
#include "xcalib/rig_file.hpp"
#include "xcalib/stream/interrupts.hpp"

namespace xcalib::cli {
namespace {

struct BenchArguments {
    std::string rig, reference = "640x480", source = "640x512";
    int frames = 10000;
};

std::pair<int, int> size_of(const std::string& flag, const std::string& text) {
    int width = 0, height = 0;
    char rest = 0;
    if (std::sscanf(text.c_str(), "%dx%d%c", &width, &height, &rest) != 2 || width < 1 ||
        height < 1)
        throw InputError(flag + " is '" + text + "', expected a size in px, such as 640x480");
    return {width, height};
}

const char* dtype_of(PixelType type) {
    switch (type) {
        case PixelType::u8: return "uint8";
        case PixelType::u16: return "uint16";
        case PixelType::f32: break;
    }
    return "float32";
}

void run(const BenchArguments& a, Console& console) {
    const auto [width, height] = size_of("--reference", a.reference);
    const auto [source_width, source_height] = size_of("--source", a.source);
    const Rig rig =
        a.rig.empty() ? benchmark_rig(width, height, source_width, source_height) : load_rig(a.rig);
    console.line(frame_benchmark_heading());
    for (const FrameBenchmark& benchmark : frame_benchmarks(rig, a.frames)) {
        check_interrupts();
        const FrameBenchmarkResult r = run_frame_benchmark(benchmark);
        console.line(to_text(r));
        console.result({{"reference_size", {rig.reference.width, rig.reference.height}},
                        {"source_size", {rig.source.width, rig.source.height}},
                        {"type", dtype_of(r.benchmark.type)},
                        {"channels", r.benchmark.channels},
                        {"integer_depth", r.benchmark.integer_depth},
                        {"num_threads", r.benchmark.num_threads},
                        {"occlusion", word_of(r.benchmark.occlusion)},
                        {"frames", r.benchmark.frames},
                        {"median_ms", r.median_ms},
                        {"p99_ms", r.p99_ms},
                        {"worst_ms", r.worst_ms},
                        {"frames_per_second", r.frames_per_second},
                        {"resident_kib", r.resident_kib}});
    }
}

}  // namespace

void add_bench(CLI::App& app, Console& console) {
    CLI::App* command =
        app.add_subcommand("bench", "Time the registration of frames on this machine.");
    auto arguments = std::make_shared<BenchArguments>();
    BenchArguments& a = *arguments;
    command
        ->add_option("--rig", a.rig,
                     "Rig file whose image sizes and baseline to time.  [default: cameras side by"
                     " side of the sizes below]")
        ->type_name("RIG");
    command->add_option("--reference", a.reference, "Size of the reference images [px].")
        ->type_name("WxH")
        ->capture_default_str();
    command->add_option("--source", a.source, "Size of the source images [px].")
        ->type_name("WxH")
        ->capture_default_str();
    command->add_option("--frames", a.frames, "Frames of each kind.")
        ->type_name("N")
        ->check(CLI::Range(1, 100000000))
        ->capture_default_str();
    command->fallthrough();
    command->callback([arguments, &console] { run(*arguments, console); });
}

}  // namespace xcalib::cli

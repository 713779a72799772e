#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "commands.hpp"
#include "files.hpp"
#include "frames.hpp"
#include "registration.hpp"
#include "xcalib/overlay.hpp"
#include "xcalib/rig_file.hpp"

namespace xcalib::cli {
namespace {

namespace fs = std::filesystem;

const std::map<std::string, Occlusion> kOcclusions = {
    {"ignore", Occlusion::ignore}, {"mark", Occlusion::mark}, {"hide", Occlusion::hide}};

// Frames a second, by the median; 25 where the stream does not tell.
double frame_rate(const Stream& stream) {
    const double period = stream.times ? median_period(*stream.times) : 0.0;
    return period > 0 ? 1 / period : 25.0;
}

Totals register_files(const RegisterArguments& arguments, const Frames& frames, const Rig& rig,
                      Console& console) {
    const cv::Mat reference = (*frames.references)[0], source = (*frames.sources)[0];
    const std::unique_ptr<Sink> sink = open_sink(arguments.output, frame_rate(*frames.references));
    // Decoding and encoding take longer than registering: frames go through side by side where
    // their order does not matter, each by one thread.
    RegistrarOptions options = arguments.options;
    int workers = 1;
    if (sink->concurrent()) {
        workers = options.num_threads > 0
                      ? options.num_threads
                      : static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
        workers = std::min(workers, frames.size());
        if (workers > 1) options.num_threads = 1;
    }
    const Registrar registrar(fitted(rig, reference.cols, reference.rows, source.cols, source.rows),
                              options);

    Totals totals;
    std::mutex mutex, reading;
    const bool read_one_by_one = !frames.references->concurrent() || !frames.sources->concurrent();
    int next = 0, first_failed = frames.size();
    std::exception_ptr failure;
    const auto work = [&] {
        while (true) {
            std::unique_lock lock(reading);
            const int index = next;
            if (index >= frames.size()) return;
            ++next;
            if (!read_one_by_one) lock.unlock();
            try {
                const Frame frame = frames.read(index);
                if (lock) lock.unlock();
                const Registered result = registered(registrar, frame.reference, frame.source,
                                                     frame.depth, arguments.overlays);
                sink->write(frames.references->name(index), result);
                const std::lock_guard guard(mutex);
                ++totals.frames;
                totals.valid +=
                    static_cast<long>(result.mask.total()) - cv::countNonZero(result.mask);
                totals.pixels += static_cast<long>(result.mask.total());
                console.progress("registering", static_cast<double>(totals.frames) / frames.size());
            } catch (...) {
                if (!lock) lock.lock();
                // The first in order is told, whichever came first in time.
                if (index < first_failed) {
                    first_failed = index;
                    failure = std::current_exception();
                }
                next = frames.size();
                return;
            }
        }
    };
    const auto start = std::chrono::steady_clock::now();
    std::vector<std::thread> threads;
    for (int i = 1; i < workers; ++i) threads.emplace_back(work);
    work();
    for (std::thread& thread : threads) thread.join();
    if (failure) std::rethrow_exception(failure);
    sink->close();
    totals.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return totals;
}

void check_output(const RegisterArguments& a) {
    const fs::path output = fs::weakly_canonical(a.output);
    if (!a.live)
        for (const std::string& input : {a.frames.reference, a.frames.source, a.frames.depth.spec})
            if (fs::weakly_canonical(input) == output)
                throw InputError("output folder " + a.output +
                                 " is an input folder, expected another");
    if (is_video_output(a.output)) check_file_writable(a.output);
    else check_folder_writable(a.output);
}

void run(RegisterArguments a, Console& console) {
    a.options.occlusion = kOcclusions.at(a.occlusion);
    const Rig rig = load_rig(a.rig);
    Totals totals;
    if (a.live) {
        check_output(a);
        totals = register_live(a, rig, console);
    } else {
        if (a.depth_fd >= 0) throw InputError("--depth-fd goes with --live");
        const Frames frames = open_frames(a.frames, rig, console);
        check_output(a);
        totals = register_files(a, frames, rig, console);
    }
    const double share = totals.pixels ? static_cast<double>(totals.valid) / totals.pixels : 0.0;
    const double speed = totals.frames / std::max(totals.seconds, 1e-9);
    char line[200];
    std::snprintf(line, sizeof line, "%d frames, %.1f %% valid, %.1f frames/s %s: ", totals.frames,
                  100 * share, speed, a.live ? "live" : "with files");
    console.line(line + a.output);
    console.result({{"frames", totals.frames},
                    {"valid_share", share},
                    {"frames_per_second", speed},
                    {"output", a.output}});
    if (totals.valid == 0) throw NotTrusted("no pixel of " + a.output + " is valid; see its masks");
}

}  // namespace

Registered registered(const Registrar& registrar, const cv::Mat& reference, const cv::Mat& source,
                      const cv::Mat& depth, bool with_overlay) {
    const Pinhole& grid = registrar.rig().reference;
    Registered out;
    out.image.create(grid.height, grid.width, source.type());
    out.mask.create(grid.height, grid.width, CV_8UC1);
    registrar.register_frame(view_of(source), view_of(depth), mutable_view_of(out.image),
                             out.mask.data);
    if (with_overlay) {
        const cv::Mat valid = out.mask == 0;
        out.overlay = cv::Mat(overlay(view_of(reference), view_of(out.image), valid.data), true)
                          .reshape(3, grid.height);
    }
    return out;
}

void add_register(CLI::App& app, Console& console) {
    CLI::App* command =
        app.add_subcommand("register", "Bring SOURCE images onto the REFERENCE pixels.");
    command->footer(
        "Images keep the source's type. Masks: 0 valid, 1 outside the source, 2 occluded, 3 no"
        " depth.\nWith --live REFERENCE and SOURCE are cameras: an index of V4L2 (0 is"
        " /dev/video0), or any source\nthat OpenCV opens: a device, a URL, a GStreamer pipeline.");
    auto arguments = std::make_shared<RegisterArguments>();
    RegisterArguments& a = *arguments;
    command->add_option("RIG", a.rig)->required();
    add_frames(*command, a.frames);
    command
        ->add_option("-o,--output", a.output,
                     "Folder to write to: images under the reference's names, and masks/. Or a"
                     " video: .mp4, .avi (8 bit), .mkv (without loss, gray also 16 bit), and its"
                     " masks.")
        ->type_name("OUT")
        ->required();
    command->add_flag("--overlay", a.overlays, "Also write red-cyan overlays/.");
    command->add_flag("--nearest", a.options.nearest,
                      "Take the nearest source pixel as it is: radiometric counts are never mixed."
                      "  [default: bilinear]");
    command
        ->add_option("--occlusion", a.occlusion,
                     "What the source sees something nearer in front of: told by the mask (mark),"
                     " or black as well (hide).")
        ->type_name("HOW")
        ->check(CLI::IsMember({"ignore", "mark", "hide"}))
        ->capture_default_str();
    add_threads(*command, a.options.num_threads);
    CLI::Option* live = command->add_flag("--live", a.live, "REFERENCE and SOURCE are cameras.");
    command
        ->add_option("--depth-fd", a.depth_fd,
                     "Live: read depth maps from this file descriptor (docs/cli.md has the"
                     " format).")
        ->type_name("N")
        ->check(CLI::NonNegativeNumber);
    command
        ->add_option("--depth-sync", a.depth_sync,
                     "Live: register with the latest depth map, or wait for one for each frame.")
        ->type_name("HOW")
        ->check(CLI::IsMember({"latest", "each"}))
        ->needs(live)
        ->capture_default_str();
    command->add_option("--frames", a.max_frames, "Live: stop after so many.  [default: never]")
        ->type_name("N")
        ->check(CLI::PositiveNumber)
        ->needs(live);
    command->add_option("--rate", a.rate, "Live: frames a second of a video that is written.")
        ->type_name("HZ")
        ->check(CLI::PositiveNumber)
        ->needs(live)
        ->capture_default_str();
    command->add_flag("--quiet", console.quiet, "No progress.");
    command->fallthrough();
    command->callback([arguments, &console] { run(*arguments, console); });
}

}  // namespace xcalib::cli

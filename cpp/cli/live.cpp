#include <chrono>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "capture.hpp"
#include "depth.hpp"
#include "depth_stream.hpp"
#include "encoder.hpp"
#include "pictures.hpp"
#include "registration.hpp"
#include "xcalib/depth/complete_depth.hpp"
#include "xcalib/depth/steady_depth.hpp"
#include "xcalib/stream/interrupts.hpp"

namespace xcalib::cli {
namespace {

using Clock = std::chrono::steady_clock;

double milliseconds_since(Clock::time_point start) {
    return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

void check(const RegisterArguments& a) {
    const bool from_fd = a.depth_fd >= 0;
    if (from_fd == !a.frames.depth.spec.empty() || (!from_fd && a.frames.depth.spec != "plane"))
        throw InputError("--live: expected either --depth-fd N or --depth plane");
    a.frames.depth.plane.validate();
}

}  // namespace

Registration register_live(const RegisterArguments& a, const Rig& rig, Console& console) {
    check(a);
    Capture references(a.frames.reference), sources(a.frames.source);
    std::unique_ptr<DepthStream> stream;
    if (a.depth_fd >= 0) stream = std::make_unique<DepthStream>(a.depth_fd);
    const DepthPointer plane = plane_depth(a.frames.depth.plane);
    FfmpegCodecs codecs;
    // The cameras are there: what another run wrote may go now, where that was asked for.
    Journal journal(journal_of(a.output),
                    {{"command", "xcalib-cli"},
                     {"xcalib", XCALIB_VERSION},
                     {"live", "yes"},
                     {"rate", std::to_string(a.rate)},
                     {"encoder", codecs.encoder_name()}},
                    true);
    const std::unique_ptr<Sink> sink = open_sink(a.output, a.rate, &journal, codecs);
    sink->begin({});
    std::vector<FrameName> names;
    std::unique_ptr<Registrar> registrar;
    DepthSteadier steadier;
    Registration totals;
    const auto start = Clock::now();
    const auto all_frames = [&] {
        while (!interrupted() && (a.max_frames == 0 || totals.frames < a.max_frames)) {
            // Both are taken before either is decoded: as near in time as two calls can be.
            if (!references.grab() || !sources.grab()) break;
            const Picture reference = picture_of(references.retrieve()),
                          source = picture_of(sources.retrieve());
            Picture depth;
            std::optional<DepthMap> map;
            if (stream) {
                map = a.depth_sync == "each" ? stream->next() : stream->latest();
                if (!map) break;
                depth = picture_of(map->depth);
            } else {
                depth = (*plane)(0, reference);
            }
            if (a.frames.depth.steady)
                depth = picture_of(steadier(totals.frames, depth.view, reference.view));
            if (a.frames.depth.complete)
                depth = picture_of(
                    completed(depth.view, reference.view, a.frames.depth.completion_confidence));
            if (!registrar)
                registrar = std::make_unique<Registrar>(
                    fitted(rig, reference.view.width, reference.view.height, source.view.width,
                           source.view.height),
                    a.options.registrar);
            const auto before = Clock::now();
            const Registered result =
                registered(*registrar, reference, source, depth, a.options.overlays);
            const double took = milliseconds_since(before);
            const std::string name = six_digits(totals.frames);
            names.push_back({name, name});
            sink->write(totals.frames, names.back(), result);
            const long pixels = static_cast<long>(result.mask.view.width) * result.mask.view.height;
            const long valid = valid_pixels(result.mask.view);
            Json event{{"name", name},
                       {"valid_share", static_cast<double>(valid) / static_cast<double>(pixels)},
                       {"register_ms", took}};
            if (stream) event["depth_timestamp_us"] = map->timestamp_us;
            console.event("frame", event);
            ++totals.frames;
            ++totals.made;
            totals.valid += valid;
            totals.pixels += pixels;
        }
    };
    try {
        all_frames();
        totals.seconds = milliseconds_since(start) / 1e3;
        if (totals.frames == 0)
            throw std::runtime_error("no frame came from " + a.frames.reference + ", " +
                                     a.frames.source + (stream ? " and the depth stream" : ""));
        sink->finish(names, [] {});
        std::filesystem::remove(journal_of(a.output));  // there is nothing to go on with
    } catch (const std::exception&) {
        sink->keep();
        if (totals.frames > 0 && is_video_output(a.output))
            console.note("what came is kept in parts: `xcalib-cli join " + a.output +
                         "` makes a video of them");
        throw;
    }
    return totals;
}

}  // namespace xcalib::cli

#include "xcalib/stream/register_frames.hpp"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <map>

#include "base/format.hpp"
#include "base/parallel.hpp"
#include "xcalib/error.hpp"
#include "xcalib/footage/fingerprint.hpp"
#include "xcalib/judge/overlay.hpp"
#include "xcalib/option_words.hpp"
#include "xcalib/stream/interrupts.hpp"
#include "xcalib/stream/outputs.hpp"

namespace xcalib {
namespace {

// So many more frames are under way than are worked on: they wait for their turn where a stage
// takes them in order, with what the stages before have done.
constexpr int kWaiting = 4;

std::string percentages(const BusyShares& busy) {
    std::string text;
    for (const auto& [name, share] : busy)
        text += format("%s%s %.0f %%", text.empty() ? "" : ", ", name.c_str(), 100 * share);
    return text;
}

const char* text_of(bool value) { return value ? "yes" : "no"; }

// All that an output depends on, but for the frames and how fast it is made.
MadeWith made_with_of(const Rig& rig, const std::filesystem::path& output,
                      const RegistrationOptions& options, const std::string& command,
                      const MadeWith& inputs, Codecs& codecs) {
    MadeWith text = {{"command", command},
                     {"xcalib", XCALIB_VERSION},
                     {"rig", fingerprint(rig)},
                     {"overlay", text_of(options.overlays)},
                     {"nearest", text_of(options.registrar.nearest)},
                     {"occlusion", word_of(options.registrar.occlusion)}};
    text.insert(text.end(), inputs.begin(), inputs.end());
    if (is_video_output(output)) text.emplace_back("encoder", codecs.encoder_name());
    return text;
}

// The frames to go through: those that are missing, and, for depth that depends on the frames
// before, these too.
std::vector<int> frames_needed(const Frames& frames, const std::vector<bool>& missing) {
    std::vector<int> needed;
    int last = -1;
    for (int i = 0; i < frames.size(); ++i)
        if (missing[i]) last = i;
    for (int i = 0; i <= last; ++i)
        if (missing[i] || frames.depth->steadied()) needed.push_back(i);
    return needed;
}

long not_finite_pixels(const ImageView& image) {
    if (image.type != PixelType::f32) return 0;
    constexpr std::uint32_t kExponent = 0x7f800000;  // all ones: infinite, or not a number
    long count = 0;
    for (int y = 0; y < image.height; ++y) {
        const auto* row = image.row<float>(y);
        for (int x = 0; x < image.width; ++x) {
            bool found = false;
            for (int c = 0; c < image.channels; ++c) {
                std::uint32_t bits;
                std::memcpy(&bits, &row[image.channels * x + c], sizeof bits);
                found = found || (bits & kExponent) == kExponent;
            }
            count += found;
        }
    }
    return count;
}

// Nothing that is read is written to.
void check_over_inputs(const Frames& frames, const std::vector<std::filesystem::path>& other_reads,
                       const std::filesystem::path& output, const std::vector<FrameName>& names,
                       bool overlays) {
    std::vector<std::string> reads = files_of(frames);
    for (const std::filesystem::path& file : other_reads) reads.push_back(file.string());
    Writes writes{output_files(output, names, overlays), output_folders(output, overlays)};
    writes.files.push_back(journal_of(output).string());
    check_apart(reads, writes);
}

// The rig at the size of the images, which the first frame that can be decoded tells.
Rig fitted_to_images(const Rig& rig, const Frames& frames) {
    for (int i = 0;; ++i) {
        try {
            const ImageView reference = (*frames.references)[i].view;
            const ImageView source = (*frames.sources)[i].view;
            return fitted(rig, reference.width, reference.height, source.width, source.height);
        } catch (const DecodeError&) {
            if (i + 1 == frames.size()) throw;
        }
    }
}

// A frame on its way; what no later stage needs is let go.
struct Passing {
    Frame frame;
    Registered result;
};

}  // namespace

double frame_rate(const Stream& references) {
    const double period = references.times ? median_period(*references.times) : 0.0;
    return period > 0 ? 1 / period : 25.0;
}

double Registration::speed() const { return made / std::max(seconds, 1e-9); }

std::string Registration::line() const {
    const int left = frames - earlier - made;
    return format("%d of %d frames, %.1f frames/s, %.0f s left, busy: ", earlier + made, frames,
                  speed(), left / std::max(speed(), 1e-9)) +
           percentages(busy);
}

std::string Registration::summary() const {
    std::string text = std::to_string(frames) + " frames";
    if (earlier) text += format(" (%d from before)", earlier);
    text += format(", %.1f %% valid", pixels ? 100.0 * valid / pixels : 0.0);
    if (not_finite) text += format(", %ld source pixels are not finite, masked", not_finite);
    if (made) text += format(", %.1f frames/s", speed());
    if (made && !busy.empty()) text += " with files, busy: " + percentages(busy);
    return text;
}

Registered registered(const Registrar& registrar, const Picture& reference, const Picture& source,
                      const Picture& depth, bool with_overlay) {
    const Pinhole& grid = registrar.rig().reference;
    Registered out;
    MutableImageView image, mask;
    out.image = new_picture(grid.width, grid.height, source.view.channels, source.view.type, image);
    out.mask = new_picture(grid.width, grid.height, 1, PixelType::u8, mask);
    auto* codes = static_cast<std::uint8_t*>(mask.data);
    registrar.register_frame(source.view, depth.view, image, codes);
    if (with_overlay) {
        std::vector<std::uint8_t> valid(static_cast<std::size_t>(grid.width) * grid.height);
        std::transform(codes, codes + valid.size(), valid.begin(),
                       [](std::uint8_t code) { return code == 0; });
        const auto both = std::make_shared<const std::vector<std::uint8_t>>(
            overlay(reference.view, out.image.view, valid.data()));
        out.overlay = {{both->data(), grid.width, grid.height, 3, PixelType::u8, 3L * grid.width},
                       both};
    }
    return out;
}

std::vector<FrameName> frame_names(const Frames& frames) {
    std::map<std::string, std::string> stamps;
    const auto stamp = [&stamps](const std::filesystem::path& file) {
        std::string& text = stamps[file.string()];
        if (text.empty())
            for (const std::string& part : file_stamp(file)) text += "\n" + part;
        return text;
    };
    std::vector<FrameName> names;
    for (int index = 0; index < frames.size(); ++index) {
        FrameName frame{"", frames.references->name(index)};
        std::string made_of = frame.name;
        for (const StreamPointer& images : {frames.references, frames.sources}) {
            const std::filesystem::path file = images->file(index);
            // Where in the file it is, however the user wrote its path.
            std::string where = images->where(index);
            if (where.rfind(file.string(), 0) == 0) where.erase(0, file.string().size());
            made_of += stamp(file) + "\n" + where;
        }
        for (const std::filesystem::path& file : frames.depth->files(index)) made_of += stamp(file);
        if (frames.depth->steadied() && !names.empty()) made_of += "\n" + names.back().key;
        frame.key = fingerprint(made_of);
        names.push_back(std::move(frame));
    }
    return names;
}

BegunRegistration::BegunRegistration(const Frames& frames, const Rig& rig,
                                     const std::filesystem::path& output,
                                     const RegistrationOptions& options, const std::string& command,
                                     const MadeWith& inputs,
                                     const std::vector<std::filesystem::path>& other_reads,
                                     Codecs& codecs) {
    check_output_writable(output);
    names = frame_names(frames);
    check_over_inputs(frames, other_reads, output, names, options.overlays);
    check_alone(output);
    sized = fitted_to_images(rig, frames);
    made_with = made_with_of(rig, output, options, command, inputs, codecs);
    journal = std::make_unique<Journal>(journal_of(output), made_with, options.overwrite);
    if (journal->is_new() && !options.overwrite)
        check_not_others(output, output_files(output, names, options.overlays));
    const double rate = options.rate > 0 ? options.rate : frame_rate(*frames.references);
    sink = open_sink(output, rate, journal.get(), codecs, options.part_frames);
    there = sink->begin(names);
}

Registration register_frames(const Frames& frames, const Rig& rig,
                             const std::filesystem::path& output,
                             const RegistrationOptions& options, const std::string& command,
                             const MadeWith& inputs,
                             const std::vector<std::filesystem::path>& other_reads, Codecs& codecs,
                             const std::function<void(const Registration&)>& progress) {
    const BegunRegistration begun(frames, rig, output, options, command, inputs, other_reads,
                                  codecs);
    const std::vector<FrameName>& names = begun.names;
    const Rig& sized = begun.sized;
    Sink& sink = *begun.sink;

    Registration total;
    total.frames = frames.size();
    total.pixels = static_cast<long>(sized.reference.width) * sized.reference.height * total.frames;
    std::vector<bool> missing;
    for (const FrameName& frame : names) {
        const auto found = begun.there.find(frame.key);
        missing.push_back(found == begun.there.end());
        if (missing.back()) continue;
        ++total.earlier;
        total.valid += found->second;
    }
    const std::vector<int> needed = frames_needed(frames, missing);

    int threads = resolve_threads(options.registrar.num_threads);
    if (threads > 1) threads += kWaiting;
    threads = std::min(threads, std::max(1, static_cast<int>(needed.size())));
    RegistrarOptions one_thread = options.registrar;  // frames are what is done in parallel
    if (threads > 1) one_thread.num_threads = 1;
    const Registrar registrar(sized, one_thread);

    std::vector<Passing> passing(static_cast<std::size_t>(threads));
    std::atomic<int> made{0};  // by this run, as `valid` is of it
    std::atomic<long> valid{0}, not_finite{0};
    const bool looks = options.overlays || frames.depth->looks_at_reference();
    // A stage by what it does with a frame on its way; `in_order` unless several may.
    const auto stage = [&](const char* name, bool concurrent, auto work) {
        return Stage{name, !concurrent, [&, work](int place, int slot) {
                         work(passing[static_cast<std::size_t>(slot)], needed[place]);
                     }};
    };
    const std::vector<Stage> stages = {
        stage("decode", frames.references->concurrent(),
              [&](Passing& p, int i) {
                  Stream& references = *frames.references;
                  p.frame.reference = looks ? references[i] : references.outline(i);
              }),
        stage("decode", frames.sources->concurrent(),
              [&](Passing& p, int i) {
                  if (!missing[i]) return;
                  p.frame.source = (*frames.sources)[i];
                  not_finite += not_finite_pixels(p.frame.source.view);
              }),
        stage("depth", frames.depth->concurrent(),
              [&](Passing& p, int i) { p.frame.depth = (*frames.depth)(i, p.frame.reference); }),
        // What cannot be read ends all that would come after it: nothing of that is written.
        stage("depth", false, [](Passing&, int) {}),
        stage("warp", true,
              [&](Passing& p, int i) {
                  if (missing[i])
                      p.result = registered(registrar, p.frame.reference, p.frame.source,
                                            p.frame.depth, options.overlays);
                  p.frame = {};
              }),
        stage("encode", sink.concurrent(), [&](Passing& p, int i) {
            const Registered result = std::move(p.result);
            if (!missing[i]) return;
            sink.write(i, names[i], result);
            ++made;
            valid += valid_pixels(result.mask.view);
        })};

    const auto start = std::chrono::steady_clock::now();
    const long valid_before = total.valid;
    const auto look = [&](const BusyShares& busy) {
        total.made = made;
        total.valid = valid_before + valid;
        total.not_finite = not_finite;
        total.busy = busy;
        total.seconds =
            std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    };
    const auto check = [](const std::string& state) {
        if (interrupted())
            throw Interrupted("interrupted; " + state + ", the same command goes on from there");
    };
    try {
        run_stages(static_cast<int>(needed.size()), stages, threads,
                   [&](int, const BusyShares& busy) {
                       look(busy);
                       progress(total);
                       check_interrupts();
                   });
    } catch (const Interrupted&) {
        sink.keep();
        check(format("%d of %d frames are done", total.earlier + made.load(), total.frames));
        throw;
    }
    sink.finish(names, [&] { check("all frames are done, but not yet in one video"); });
    look(total.busy);
    return total;
}

}  // namespace xcalib

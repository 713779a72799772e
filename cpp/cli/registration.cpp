#include "registration.hpp"

#include <charconv>
#include <chrono>
#include <condition_variable>
#include <cstdlib>
#include <mutex>
#include <thread>

#include "encoder.hpp"
#include "files.hpp"
#include "xcalib/footage/fingerprint.hpp"
#include "xcalib/judge/overlay.hpp"

namespace xcalib::cli {
namespace {

// Frames a second, by the median; 25 where the stream does not tell.
double frame_rate(const Stream& stream) {
    const double period = stream.times ? median_period(*stream.times) : 0.0;
    return period > 0 ? 1 / period : 25.0;
}

// -- What a frame, and an output, is made of: as the Python command says it -----------------------

// A key for each frame that changes with the files it is made of: their names, sizes, times. Depth
// that depends on the frames before makes the key depend on them as well.
std::vector<FrameName> frame_names(const Frames& frames) {
    std::map<Path, std::string> stamps;
    const auto stamp = [&stamps](const Path& file) {
        std::string& text = stamps[file];
        if (text.empty())
            for (const std::string& part : file_stamp(file)) text += "\n" + part;
        return text;
    };
    std::vector<FrameName> names;
    for (int index = 0; index < frames.size(); ++index) {
        FrameName frame{"", frames.references->name(index)};
        std::string made_of = frame.name;
        for (const StreamPointer& images : {frames.references, frames.sources}) {
            const Path file = images->file(index);
            // Where in the file it is.
            made_of += stamp(file) + "\n" + images->where(index).substr(file.string().size());
        }
        for (const Path& file : frames.depth->files(index)) made_of += stamp(file);
        if (frames.depth->steadied() && !names.empty()) made_of += "\n" + names.back().key;
        frame.key = fingerprint(made_of);
        names.push_back(std::move(frame));
    }
    return names;
}

std::string text_of(bool value) { return value ? "True" : "False"; }

// The shortest decimal that reads back as the number.
std::string text_of(double value) {
    char digits[40];
    const auto end =
        std::to_chars(digits, digits + sizeof digits, value, std::chars_format::scientific);
    const std::string shortest(digits, end.ptr);
    const std::size_t e = shortest.find('e');
    const int exponent = e == std::string::npos ? 0 : std::atoi(shortest.c_str() + e + 1);
    if (exponent < -4 || exponent >= 16) return shortest;
    const auto fixed =
        std::to_chars(digits, digits + sizeof digits, value, std::chars_format::fixed);
    const std::string text(digits, fixed.ptr);
    return text.find_first_of(".n") == std::string::npos ? text + ".0" : text;
}

std::string text_of(const std::optional<double>& value) { return value ? text_of(*value) : "None"; }

std::string table_text(const std::string& file) {
    if (file.empty()) return "None";
    return absolute_path(file).string() + " (" + fingerprint(read_file(file)) + ")";
}

// All that an output depends on, but for the frames and how fast it is made.
MadeWith made_with(const RegisterArguments& a, const Rig& rig) {
    const FrameArguments& frames = a.frames;
    const DepthArguments& depth = frames.depth;
    MadeWith text = {
        {"xcalib", XCALIB_VERSION},
        {"rig", fingerprint(rig)},
        {"overlay", text_of(a.overlays)},
        {"nearest", text_of(a.options.nearest)},
        {"occlusion", a.occlusion},
        {"reference", absolute_path(frames.reference).string()},
        {"source", absolute_path(frames.source).string()},
        {"depth_spec", depth.spec == "plane" ? depth.spec : absolute_path(depth.spec).string()},
        {"depth_scale", text_of(depth.scale)},
        {"camera_height", text_of(depth.plane.camera_height)},
        {"horizon", text_of(depth.plane.horizon)},
        {"far", text_of(depth.plane.far)},
        {"plane_hfov", text_of(depth.plane.hfov_deg)},
        {"plane_roll", text_of(depth.plane.roll_deg)},
        {"depth_steady", text_of(depth.steady)},
        {"complete", text_of(depth.complete)},
        {"completion_confidence", text_of(depth.completion_confidence)},
        {"pairing", frames.pairing},
        {"time_offset", text_of(frames.time_offset)},
        {"max_gap", text_of(frames.max_gap)},
        {"reference_times", table_text(frames.reference_times)},
        {"source_times", table_text(frames.source_times)},
        {"providers", "cpu"}};
    // What else only the Python command takes.
    for (const char* name :
         {"depth_recipe", "depth_focal", "inverse_scale", "inverse_shift", "lidar_calibration",
          "stereo_calibration", "stereo_baseline", "stereo_focal", "stereo_doffs"})
        text.emplace_back(name, "None");
    if (is_video_output(a.output)) text.emplace_back("encoder", encoder_name());
    return text;
}

// -- Frames side by side --------------------------------------------------------------------------

// Decode, depth, warp and encode of different frames at the same time: a worker takes a frame
// through all of it. What must be one by one is: reading, where the frames of a file or of steadied
// depth follow on each other, and writing, where they make a video.
class Work {
   public:
    Work(const RegisterArguments& arguments, const Frames& frames, const Registrar& registrar,
         const std::vector<FrameName>& names, const std::vector<bool>& todo, Sink& sink)
        : arguments_(arguments), frames_(frames), registrar_(registrar), names_(names), todo_(todo),
          sink_(sink), reads_in_order_(!frames.references->concurrent() ||
                                       !frames.sources->concurrent() || frames.depth->steadied()) {
        int last = -1;
        for (int i = 0; i < frames.size(); ++i)
            if (missing(i)) last = i;
        // For depth that depends on the frames before, these too.
        for (int i = 0; i <= last; ++i)
            if (missing(i) || frames.depth->steadied()) plan_.push_back(i);
        failed_ = plan_.size();
    }

    // Until all is done, interrupted, or failed: then the error of the first frame that did.
    template <class Told>
    void run(int workers, const Told& told) {
        const auto work = [&] {
            while (step(told)) {
            }
        };
        std::vector<std::thread> threads;
        for (int i = 1; i < workers; ++i) threads.emplace_back(work);
        work();
        for (std::thread& thread : threads) thread.join();
        if (failure_) std::rethrow_exception(failure_);
    }

    int made = 0;
    long valid = 0;

   private:
    bool missing(int index) const { return todo_[static_cast<std::size_t>(index)]; }

    // One frame; false where there is none left to take.
    template <class Told>
    bool step(const Told& told) {
        std::unique_lock reading(reading_);
        const std::size_t place = next_;
        if (interrupted || place >= failed_) return false;
        ++next_;
        if (!reads_in_order_) reading.unlock();
        const int index = plan_[place];
        try {
            Frame frame;
            frame.reference = (*frames_.references)[index];
            if (missing(index)) frame.source = (*frames_.sources)[index];
            frame.depth = (*frames_.depth)(index, frame.reference);
            if (reading) reading.unlock();
            Registered result;
            if (missing(index))
                result = registered(registrar_, frame.reference, frame.source, frame.depth,
                                    arguments_.overlays);
            if (!wait_for_turn(place)) return false;
            if (missing(index)) {
                sink_.write(index, names_[static_cast<std::size_t>(index)], result);
                const std::lock_guard lock(state_);
                ++made;
                valid += valid_pixels(result.mask);
                told(made);
            }
            end_turn(place);
        } catch (...) {
            const std::lock_guard lock(state_);
            // The first in order is told, whichever came first in time.
            if (place < failed_) {
                failed_ = place;
                failure_ = std::current_exception();
            }
            turns_.notify_all();
            return false;
        }
        return true;
    }

    // False where a frame before has failed: nothing is written after it.
    bool wait_for_turn(std::size_t place) {
        if (sink_.concurrent()) return true;
        std::unique_lock lock(state_);
        turns_.wait(lock, [&] { return written_ == place || failed_ < place; });
        return failed_ >= place;
    }

    void end_turn(std::size_t place) {
        const std::lock_guard lock(state_);
        written_ = place + 1;
        turns_.notify_all();
    }

    const RegisterArguments& arguments_;
    const Frames& frames_;
    const Registrar& registrar_;
    const std::vector<FrameName>& names_;
    const std::vector<bool>& todo_;
    Sink& sink_;
    const bool reads_in_order_;
    std::vector<int> plan_;  // frames to read, in order

    std::mutex reading_, state_;
    std::condition_variable turns_;
    std::size_t next_ = 0, written_ = 0;  // places in the plan
    std::atomic<std::size_t> failed_;
    std::exception_ptr failure_;
};

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

Totals register_files(const RegisterArguments& arguments, const Frames& frames, const Rig& rig,
                      Console& console) {
    const cv::Mat reference = (*frames.references)[0], source = (*frames.sources)[0];
    RegistrarOptions options = arguments.options;
    int workers = options.num_threads > 0
                      ? options.num_threads
                      : static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
    workers = std::min(workers, frames.size());
    if (workers > 1) options.num_threads = 1;
    const Registrar registrar(fitted(rig, reference.cols, reference.rows, source.cols, source.rows),
                              options);
    const std::vector<FrameName> names = frame_names(frames);
    Journal journal(journal_of(arguments.output), made_with(arguments, rig), arguments.overwrite);
    const std::unique_ptr<Sink> sink =
        open_sink(arguments.output, frame_rate(*frames.references), &journal);
    const std::map<std::string, long> done = sink->begin(names);

    Totals totals;
    totals.frames = frames.size();
    std::vector<bool> todo;
    for (const FrameName& frame : names) {
        const auto found = done.find(frame.key);
        todo.push_back(found == done.end());
        if (todo.back()) continue;
        ++totals.earlier;
        totals.valid += found->second;
    }
    const auto start = std::chrono::steady_clock::now();
    Work work(arguments, frames, registrar, names, todo, *sink);
    work.run(workers, [&](int made) {
        console.show("registering", static_cast<double>(totals.earlier + made) / totals.frames);
    });
    const auto check = [](const std::string& state) {
        if (interrupted)
            throw Interrupted("interrupted; " + state + ", the same command goes on from there");
    };
    check(std::to_string(totals.earlier + work.made) + " of " + std::to_string(totals.frames) +
          " frames are done");
    sink->finish(names, [&] { check("all frames are done, but not yet in one video"); });
    totals.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    totals.valid += work.valid;
    const Pinhole& grid = registrar.rig().reference;
    totals.pixels = static_cast<long>(grid.width) * grid.height * totals.frames;
    return totals;
}

}  // namespace xcalib::cli

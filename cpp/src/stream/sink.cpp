#include "xcalib/stream/sink.hpp"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <iterator>
#include <mutex>
#include <set>
#include <stdexcept>

#include "base/format.hpp"
#include "base/whole_file.hpp"
#include "xcalib/error.hpp"
#include "xcalib/stream/files.hpp"

namespace xcalib {
namespace {

namespace fs = std::filesystem;
using Path = fs::path;

// Codecs write these.
constexpr const char* kVideoSuffixes[] = {".mp4", ".avi", ".mkv"};

std::string kind_of(const ImageView& image) {
    static const std::map<PixelType, const char*> names = {
        {PixelType::u8, "uint8"}, {PixelType::u16, "uint16"}, {PixelType::f32, "float32"}};
    return std::string(names.at(image.type)) + (image.channels == 1 ? " gray" : " colour");
}

// What is in a folder that is one, and no link to another: real files only.
std::vector<Path> files_in(const Path& folder) {
    std::vector<Path> files;
    std::error_code none;
    if (!fs::is_directory(fs::symlink_status(folder, none))) return files;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder, none))
        if (fs::is_regular_file(entry.symlink_status(none))) files.push_back(entry.path());
    return files;
}

// A file that goes with a video.
Path of_video(const Path& video, const std::string& suffix) {
    return Path(video).replace_filename(video.stem().string() + suffix);
}

class FolderSink : public Sink {
   public:
    FolderSink(Path folder, Journal* journal, Codecs& codecs)
        : folder_(std::move(folder)), journal_(journal), codecs_(codecs) {}
    ~FolderSink() override {
        try {
            keep();
        } catch (const std::exception&) {
            // Something else has gone wrong before; what is not whole is thrown away.
        }
    }
    bool concurrent() const override { return true; }

    std::map<std::string, long> begin(const std::vector<FrameName>& frames) override {
        std::map<std::string, long> done;
        std::set<std::string> keys, names;
        for (const FrameName& frame : frames) {
            keys.insert(frame.key);
            for (const char* suffix : {".png", ".tiff"}) names.insert(frame.name + suffix);
        }
        // What a killed run left half-written.
        for (const char* folder : {"", "masks", "overlays"})
            for (const Path& file : files_in(folder_ / folder))
                if (names.count(complete_name(file.filename().string()))) fs::remove(file);
        if (!journal_) return done;
        for (const Unit& unit : journal_->units())
            for (const auto& [key, valid] : unit.frames)
                if (keys.count(key)) done[key] = valid;
        return done;
    }

    void write(int, const FrameName& frame, const Registered& pictures) override {
        const bool floats = pictures.image.view.type == PixelType::f32;
        std::vector<WholeFile> files;
        Unit unit{{{frame.key, valid_pixels(pictures.mask.view)}}, {}};
        const auto put = [&](const std::string& name, const Picture& picture) {
            const Path file = folder_ / name;
            const std::string data = codecs_.encode_image(file, picture);
            fs::create_directories(file.parent_path());
            files.emplace_back(file).write(data);
            unit.files.emplace_back(name, data.size());
        };
        put(frame.name + (floats ? ".tiff" : ".png"), pictures.image);
        put("masks/" + frame.name + ".png", pictures.mask);
        if (!pictures.overlay.empty()) put("overlays/" + frame.name + ".png", pictures.overlay);
        std::unique_lock lock(mutex_);
        std::move(files.begin(), files.end(), std::back_inserter(files_));
        units_.push_back(std::move(unit));
        if (units_.size() < kBatchFrames && Clock::now() - kept_ < kPatience) return;
        lock.unlock();
        keep();
    }

    // Those written since are on the disk now, have their names, and are noted: in this order.
    void keep() override {
        std::unique_lock lock(mutex_);
        std::vector<WholeFile> files = std::exchange(files_, {});
        std::vector<Unit> units = std::exchange(units_, {});
        kept_ = Clock::now();
        lock.unlock();
        if (units.empty()) return;
        keep_all(files, [&] {
            if (journal_) journal_->claim();
        });
        if (journal_) journal_->append(std::move(units));
    }

    void finish(const std::vector<FrameName>&, const std::function<void()>&) override { keep(); }

   private:
    using Clock = std::chrono::steady_clock;
    static constexpr auto kPatience = std::chrono::seconds(1);

    Path folder_;
    Journal* journal_;
    Codecs& codecs_;
    std::mutex mutex_;
    std::vector<WholeFile> files_;  // written, but not kept
    std::vector<Unit> units_;       // of these
    Clock::time_point kept_ = Clock::now();
};

// Makes the videos of parts; returns their names.
std::vector<std::string> join_units(const Path& video, const Path& folder,
                                    const std::vector<Unit>& units, double rate, Codecs& codecs,
                                    const std::function<void()>& check) {
    std::vector<std::string> names;
    for (std::size_t i = 0; i < units[0].files.size(); ++i) {
        const std::string part = Path(units[0].files[i].first).filename().string();
        const Path target = of_video(video, part.substr(part.find('.')));
        std::vector<std::pair<Path, int>> parts;
        for (const Unit& unit : units)
            parts.emplace_back(video.parent_path() / unit.files.at(i).first,
                               static_cast<int>(unit.frames.size()));
        WholeFile file(target, folder);
        codecs.join(parts, file.partial(), target, rate, check);
        file.keep();
        names.push_back(target.filename().string());
    }
    return names;
}

void remove_parts(const Path& video, const Path& folder, const std::vector<Unit>& units) {
    std::error_code ignored;
    for (const Unit& unit : units)
        for (const auto& [name, size] : unit.files) fs::remove(video.parent_path() / name, ignored);
    ::rmdir(folder.c_str());  // unless others have put something there
}

// Whether a unit is the whole video.
bool is_joined(const Unit& unit, const Path& video) {
    return std::any_of(unit.files.begin(), unit.files.end(),
                       [&](const auto& file) { return file.first == video.filename().string(); });
}

Path parts_of(const Path& video) { return video.string() + ".parts"; }

// One video; beside it NAME.masks.mkv, without loss, and NAME.overlay with its suffix.
//
// A video cannot be appended to. Frames go to parts in a folder with `.parts` behind the video's
// name; finish() copies the compressed frames of all parts into the videos, and removes the parts.
class VideoSink : public Sink {
   public:
    VideoSink(Path path, double rate, Journal* journal, Codecs& codecs, int part_frames)
        : path_(std::move(path)), parts_(parts_of(path_)), rate_(rate), journal_(journal),
          codecs_(codecs), part_frames_(part_frames) {
        if (journal) units_ = journal->units();
    }

    ~VideoSink() override {
        try {
            keep();
        } catch (const std::exception&) {
            // Something else has gone wrong before; what is not whole is thrown away.
        }
        open_.clear();
        ::rmdir(parts_.c_str());  // only if it is an empty folder
    }

    bool concurrent() const override { return false; }

    std::map<std::string, long> begin(const std::vector<FrameName>& frames) override {
        const std::vector<Unit> fitting = fitting_units(frames);
        std::set<std::string> ours;
        std::map<std::string, long> done;
        for (const Unit& unit : fitting) {
            for (const auto& [name, size] : unit.files) ours.insert(name);
            done.insert(unit.frames.begin(), unit.frames.end());
        }
        std::error_code none;
        if (fs::exists(fs::symlink_status(parts_, none)) &&
            !fs::is_directory(fs::symlink_status(parts_, none)))
            throw InputError(parts_.string() +
                             " is no folder, expected one for the parts, or another output");
        // What a killed run left half-written, or not noted, and parts of what has changed since:
        // all that is called as a part of these frames, or of those noted, is.
        std::set<std::string> keys;
        for (const FrameName& frame : frames) keys.insert(frame.key);
        for (const Unit& unit : units_) keys.insert(unit.frames[0].first);
        for (const Path& file : files_in(parts_)) {
            const std::string name = file.filename().string(), whole = complete_name(name);
            const std::string& part = whole.empty() ? name : whole;
            const bool made = keys.count(part.substr(0, part.find('.'))) ||
                              (!whole.empty() && whole == path_.filename());
            if (made && !ours.count(inside(name))) fs::remove(file);
        }
        return done;
    }

    void write(int index, const FrameName& frame, const Registered& pictures) override {
        std::vector<std::pair<Path, const Picture*>> targets = {
            {path_, &pictures.image}, {beside(".masks.mkv"), &pictures.mask}};
        if (!pictures.overlay.empty())
            targets.emplace_back(beside(".overlay" + path_.extension().string()),
                                 &pictures.overlay);
        if (static_cast<int>(frames_.size()) == part_frames_ || index != next_) keep();
        next_ = index + 1;
        if (open_.empty()) {
            for (const auto& [target, image] : targets) check_video_image(target, image->view);
            fs::create_directories(parts_);
            const std::size_t stem = path_.stem().string().size();
            for (const auto& [target, image] : targets) {
                const std::string name = frame.key + target.filename().string().substr(stem);
                WholeFile file(parts_ / name);
                auto writer = codecs_.open_part(file.partial(), target, *image, rate_);
                open_.push_back({name, std::move(file), std::move(writer)});
            }
        }
        for (std::size_t i = 0; i < targets.size(); ++i) {
            const auto& [target, image] = targets[i];
            const std::string kind = size_text(image->view) + " " + kind_of(image->view);
            // What is not like the first frame would be misread.
            const std::string& first = kinds_.emplace(target, kind).first->second;
            if (kind != first)
                throw InputError(target.string() + ": a frame is " + kind + ", the first is " +
                                 first + "; a video holds frames of one kind, a folder any");
            open_[i].writer->write(*image);
        }
        frames_.emplace_back(frame.key, valid_pixels(pictures.mask.view));
    }

    // The open part is whole now, and noted.
    void keep() override {
        // Whatever fails, neither is closed again.
        auto frames = std::exchange(frames_, {});
        auto open = std::exchange(open_, {});
        if (frames.empty()) return;
        std::vector<std::string> names;
        for (Part& part : open) {
            part.writer->close(static_cast<int>(frames.size()));
            part.file.keep();
            names.push_back(inside(part.name));
        }
        note(std::move(frames), names);
    }

    void finish(const std::vector<FrameName>& frames, const std::function<void()>& check) override {
        keep();
        const std::vector<Unit> units = fitting_units(frames);
        if (std::any_of(units.begin(), units.end(), [this](const Unit& u) { return joined(u); }))
            return;
        std::vector<std::pair<std::string, long>> all;
        for (const Unit& unit : units)
            all.insert(all.end(), unit.frames.begin(), unit.frames.end());
        const bool complete =
            all.size() == frames.size() && std::equal(all.begin(), all.end(), frames.begin(),
                                                      [](const auto& one, const FrameName& other) {
                                                          return one.first == other.key;
                                                      });
        if (!complete)
            throw std::runtime_error(parts_.string() + ": frames are missing in these parts");
        note(std::move(all), join_units(path_, parts_, units, rate_, codecs_, check));
        remove_parts(path_, parts_, units);
    }

   private:
    struct Part {
        std::string name;
        WholeFile file;
        std::unique_ptr<PartWriter> writer;  // goes before its file
    };

    Path beside(const std::string& suffix) const { return of_video(path_, suffix); }
    std::string inside(const std::string& part) const {
        return parts_.filename().string() + "/" + part;
    }
    bool joined(const Unit& unit) const { return is_joined(unit, path_); }

    // Those whose frames still follow on each other, in order.
    std::vector<Unit> fitting_units(const std::vector<FrameName>& frames) const {
        std::map<std::string, std::size_t> places;
        for (std::size_t i = 0; i < frames.size(); ++i) places[frames[i].key] = i;
        std::map<std::size_t, Unit> fitting;
        for (const Unit& unit : units_) {
            const auto first = places.find(unit.frames[0].first);
            if (first == places.end()) continue;
            bool follow = !joined(unit) || unit.frames.size() == frames.size();
            for (std::size_t i = 0; follow && i < unit.frames.size(); ++i) {
                const auto place = places.find(unit.frames[i].first);
                follow = place != places.end() && place->second == first->second + i;
            }
            if (follow) fitting[first->second] = unit;
        }
        std::vector<Unit> parts, whole;
        for (const auto& [place, unit] : fitting) {
            parts.push_back(unit);
            if (joined(unit)) whole.push_back(unit);
        }
        return whole.empty() ? parts : whole;
    }

    void note(std::vector<std::pair<std::string, long>> frames,
              const std::vector<std::string>& names) {
        Unit unit{frames, {}};
        for (const std::string& name : names)
            unit.files.emplace_back(name, fs::file_size(path_.parent_path() / name));
        units_.push_back(std::move(unit));
        if (journal_) journal_->append(std::move(frames), names);
    }

    Path path_, parts_;
    double rate_;
    Journal* journal_;
    Codecs& codecs_;
    int part_frames_;
    std::vector<Unit> units_;
    std::vector<Part> open_;
    std::map<Path, std::string> kinds_;                 // of the images, by the video
    std::vector<std::pair<std::string, long>> frames_;  // of the open part
    int next_ = 0;
};

}  // namespace

long valid_pixels(const ImageView& mask) {
    long valid = 0;
    for (int y = 0; y < mask.height; ++y)
        valid += std::count(mask.row<std::uint8_t>(y), mask.row<std::uint8_t>(y) + mask.width, 0);
    return valid;
}

bool is_video_output(const Path& output) {
    const std::string suffix = lower_suffix(output);
    return std::find(std::begin(kVideoSuffixes), std::end(kVideoSuffixes), suffix) !=
               std::end(kVideoSuffixes) &&
           !fs::is_directory(output);
}

void check_video_image(const Path& target, const ImageView& image) {
    const std::string suffix = lower_suffix(target);
    const bool lossless = suffix == ".mkv";
    const bool deep = image.type == PixelType::u16 && image.channels == 1 && lossless;
    if (image.type != PixelType::u8 && !deep)
        throw InputError(target.string() + ": the images are " + kind_of(image) + "; " + suffix +
                         " holds uint8" + (lossless ? " and gray uint16" : "") +
                         ", a folder holds any");
    if (image.width % 2 || image.height % 2)
        throw InputError(target.string() + ": the images are " + size_text(image) +
                         "; a video holds even sizes, a folder any");
}

std::vector<std::string> output_files(const Path& output, const std::vector<FrameName>& frames,
                                      bool overlays) {
    std::vector<std::string> files;
    if (is_video_output(output)) {
        files = {output.string(), of_video(output, ".masks.mkv").string()};
        if (overlays)
            files.push_back(of_video(output, ".overlay" + output.extension().string()).string());
        return files;
    }
    const std::string folder = (output / "").string();
    for (const FrameName& frame : frames) {
        for (const char* suffix : {".png", ".tiff"}) files.push_back(folder + frame.name + suffix);
        files.push_back(folder + "masks/" + frame.name + ".png");
        if (overlays) files.push_back(folder + "overlays/" + frame.name + ".png");
    }
    return files;
}

std::vector<Path> output_folders(const Path& output, bool overlays) {
    if (is_video_output(output)) return {};
    std::vector<Path> folders = {output, output / "masks"};
    if (overlays) folders.push_back(output / "overlays");
    return folders;
}

void check_not_others(const Path& output, const std::vector<std::string>& files) {
    std::error_code none;
    for (const std::string& file : files)
        if (fs::exists(fs::symlink_status(file, none)))
            throw InputError(file + " is there, and " + journal_of(output).string() +
                             " does not say that a run made it; expected another output, or"
                             " --overwrite");
}

void check_alone(const Path& output) {
    if (!is_video_output(output)) return;
    const Path folder = output.has_parent_path() ? output.parent_path() : ".";
    for (const Path& file : files_in(folder)) {
        const Path name = file.filename();
        if (name.extension() != ".jsonl" || name.stem().extension() != ".register") continue;
        const Path other = name.stem().stem();
        if (other == output.filename() || !is_video_output(folder / other) ||
            other.stem() != output.stem() || fs::file_size(file) == 0)
            continue;
        throw InputError(output.string() + " would share " +
                         of_video(output, ".masks.mkv").filename().string() + " with " +
                         (folder / other).string() + ", expected another name");
    }
}

int join_parts(const Path& output, Codecs& codecs, const std::function<void()>& check) {
    if (!is_video_output(output))
        throw InputError(output.string() + " is no video, expected the output of a live run");
    Journal journal(journal_of(output));
    if (journal.made_with("live").empty())
        throw InputError(output.string() +
                         ": its frames are of files, expected those of a live run; the same"
                         " `register` command resumes");
    const std::vector<Unit> units = journal.units();
    if (units.empty()) throw InputError(output.string() + ": no whole part of it is there");
    if (is_joined(units.back(), output)) throw InputError(output.string() + " is joined already");
    std::vector<std::pair<std::string, long>> all;
    for (const Unit& unit : units) all.insert(all.end(), unit.frames.begin(), unit.frames.end());
    const int count = static_cast<int>(all.size());
    const double rate = std::strtod(journal.made_with("rate").c_str(), nullptr);
    journal.append(std::move(all),
                   join_units(output, parts_of(output), units, rate, codecs, check));
    // What the kill left half-written is the part that was to come next.
    for (const Path& file : files_in(parts_of(output)))
        if (const std::string whole = complete_name(file.filename().string());
            whole.substr(0, whole.find('.')) == format("%06d", count))
            fs::remove(file);
    remove_parts(output, parts_of(output), units);
    return count;
}

Path journal_of(const Path& output) {
    return is_video_output(output) ? Path(output.string() + ".register.jsonl")
                                   : output / "register.jsonl";
}

std::unique_ptr<Sink> open_sink(const Path& output, double rate, Journal* journal, Codecs& codecs,
                                int part_frames) {
    if (is_video_output(output))
        return std::make_unique<VideoSink>(output, rate, journal, codecs, part_frames);
    return std::make_unique<FolderSink>(output, journal, codecs);
}

}  // namespace xcalib

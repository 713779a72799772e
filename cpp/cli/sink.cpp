#include "sink.hpp"

#include <algorithm>
#include <set>

#include "encoder.hpp"
#include "files.hpp"

namespace xcalib::cli {
namespace {

namespace fs = std::filesystem;

class FolderSink : public Sink {
   public:
    FolderSink(Path folder, Journal* journal) : folder_(std::move(folder)), journal_(journal) {}
    bool concurrent() const override { return true; }

    std::map<std::string, long> begin(const std::vector<FrameName>& frames) override {
        std::map<std::string, long> done;
        if (!journal_ || journal_->units().empty()) return done;
        remove_partial_files();
        std::set<std::string> wanted;
        for (const FrameName& frame : frames) wanted.insert(frame.key);
        for (const Unit& unit : journal_->units())
            for (const auto& [key, valid] : unit.frames)
                if (wanted.count(key)) done[key] = valid;
        return done;
    }

    void write(int, const FrameName& frame, const Registered& pictures) override {
        const bool floats = pictures.image.depth() == CV_32F;
        std::vector<std::pair<std::string, const cv::Mat*>> files = {
            {frame.name + (floats ? ".tiff" : ".png"), &pictures.image},
            {"masks/" + frame.name + ".png", &pictures.mask}};
        if (!pictures.overlay.empty())
            files.emplace_back("overlays/" + frame.name + ".png", &pictures.overlay);
        std::vector<std::string> names;
        for (const auto& [name, picture] : files) {
            write_image(folder_ / name, *picture);
            names.push_back(name);
        }
        if (journal_) journal_->append({{frame.key, valid_pixels(pictures.mask)}}, names);
    }

    void finish(const std::vector<FrameName>&, const std::function<void()>&) override {}

   private:
    // The folder is ours alone where there are units: what is partial is of a killed run.
    void remove_partial_files() const {
        for (const char* name : {"", "masks", "overlays"}) {
            std::error_code none;
            std::vector<Path> partial;
            for (const fs::directory_entry& entry : fs::directory_iterator(folder_ / name, none)) {
                const std::string file = entry.path().filename().string();
                if (file[0] == '.' && entry.path().extension() == ".partial")
                    partial.push_back(entry.path());
            }
            for (const Path& file : partial) fs::remove(file);
        }
    }

    Path folder_;
    Journal* journal_;
};

// One video; beside it NAME.masks.mkv, without loss, and NAME.overlay with its suffix.
//
// A video cannot be appended to. Frames go to parts of kPart frames in a folder with `.parts`
// behind the video's name; finish() copies the compressed frames of all parts into the videos, and
// removes the parts.
class VideoSink : public Sink {
   public:
    VideoSink(Path path, double rate, Journal* journal)
        : path_(std::move(path)), parts_(path_.string() + ".parts"), rate_(rate),
          journal_(journal) {
        if (journal) units_ = journal->units();
    }

    ~VideoSink() override {
        try {
            close_part();
        } catch (const std::exception&) {
            // Something else has gone wrong before; what is not whole is thrown away.
        }
        open_.clear();
        std::error_code ignored;
        fs::remove(parts_, ignored);  // only if nothing whole is in it
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
        // What a killed run left half-written, and parts of what has changed since.
        std::error_code none;
        std::vector<Path> others;
        for (const fs::directory_entry& entry : fs::directory_iterator(parts_, none))
            if (entry.is_regular_file() && is_part(entry.path().filename().string()) &&
                !ours.count(inside(entry.path())))
                others.push_back(entry.path());
        for (const Path& file : others) fs::remove(file);
        return done;
    }

    void write(int index, const FrameName& frame, const Registered& pictures) override {
        std::vector<std::pair<Path, const cv::Mat*>> targets = {
            {path_, &pictures.image}, {beside(".masks.mkv"), &pictures.mask}};
        if (!pictures.overlay.empty())
            targets.emplace_back(beside(".overlay" + path_.extension().string()),
                                 &pictures.overlay);
        if (frames_.size() == kPart || index != next_) close_part();
        next_ = index + 1;
        if (open_.empty()) {
            for (const auto& [target, picture] : targets) check_video_image(target, *picture);
            fs::create_directories(parts_);
            const std::size_t stem = path_.stem().string().size();
            for (const auto& [target, picture] : targets) {
                const std::string kind = target.filename().string().substr(stem);
                open_.push_back(std::make_unique<Encoder>(parts_ / (frame.key + kind), target,
                                                          *picture, rate_));
            }
        }
        for (std::size_t i = 0; i < targets.size(); ++i) open_[i]->write(*targets[i].second);
        frames_.emplace_back(frame.key, valid_pixels(pictures.mask));
    }

    void finish(const std::vector<FrameName>& frames, const std::function<void()>& check) override {
        close_part();
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
        std::vector<std::string> names;
        for (std::size_t i = 0; i < units[0].files.size(); ++i) {
            const std::string kind =
                Path(units[0].files[i].first).filename().string().substr(frames[0].key.size());
            std::vector<std::pair<Path, int>> parts;
            for (const Unit& unit : units)
                parts.emplace_back(path_.parent_path() / unit.files.at(i).first,
                                   static_cast<int>(unit.frames.size()));
            join_videos(parts, beside(kind), rate_, check);
            names.push_back(beside(kind).filename().string());
        }
        note(std::move(all), names);
        std::error_code ignored;
        fs::remove_all(parts_, ignored);
    }

   private:
    // Frames that a run that is killed, not only interrupted, can lose at most.
    static constexpr std::size_t kPart = 250;

    Path beside(const std::string& suffix) const {
        return Path(path_).replace_filename(path_.stem().string() + suffix);
    }
    std::string inside(const Path& part) const {
        return parts_.filename().string() + "/" + part.filename().string();
    }
    bool joined(const Unit& unit) const {
        return std::any_of(unit.files.begin(), unit.files.end(), [this](const auto& file) {
            return file.first == path_.filename().string();
        });
    }

    // Named by a frame's key: 16 hexadecimal digits.
    static bool is_part(const std::string& name) {
        return name.find_first_not_of("0123456789abcdef") == 16;
    }

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

    // The open part is whole now, and noted.
    void close_part() {
        // Whatever fails, neither is closed again.
        auto frames = std::exchange(frames_, {});
        const auto open = std::exchange(open_, {});
        if (frames.empty()) return;
        std::vector<std::string> names;
        for (const std::unique_ptr<Encoder>& encoder : open) {
            encoder->close(static_cast<int>(frames.size()));
            names.push_back(inside(encoder->path()));
        }
        note(std::move(frames), names);
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
    std::vector<Unit> units_;
    std::vector<std::unique_ptr<Encoder>> open_;
    std::vector<std::pair<std::string, long>> frames_;  // of the open part
    int next_ = 0;
};

}  // namespace

long valid_pixels(const cv::Mat& mask) {
    return static_cast<long>(mask.total()) - cv::countNonZero(mask);
}

bool is_video_output(const Path& output) {
    return has_suffix(output, kVideoOutputs) && !fs::is_directory(output);
}

Path journal_of(const Path& output) {
    return is_video_output(output) ? Path(output.string() + ".register.jsonl")
                                   : output / "register.jsonl";
}

std::unique_ptr<Sink> open_sink(const Path& output, double rate, Journal* journal) {
    if (is_video_output(output)) return std::make_unique<VideoSink>(output, rate, journal);
    return std::make_unique<FolderSink>(output, journal);
}

}  // namespace xcalib::cli

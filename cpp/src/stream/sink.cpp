#include "xcalib/stream/sink.hpp"

#include <algorithm>
#include <set>
#include <stdexcept>

#include "xcalib/error.hpp"

namespace xcalib {
namespace {

namespace fs = std::filesystem;
using Path = fs::path;

// Codecs write these.
constexpr const char* kVideoSuffixes[] = {".mp4", ".avi", ".mkv"};

std::string lower_suffix(const Path& file) {
    std::string suffix = file.extension().string();
    for (char& c : suffix)
        if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    return suffix;
}

std::string kind_of(const ImageView& image) {
    static const std::map<PixelType, const char*> names = {
        {PixelType::u8, "uint8"}, {PixelType::u16, "uint16"}, {PixelType::f32, "float32"}};
    return std::string(names.at(image.type)) + (image.channels == 1 ? " gray" : " colour");
}

class FolderSink : public Sink {
   public:
    FolderSink(Path folder, Journal* journal, Codecs& codecs)
        : folder_(std::move(folder)), journal_(journal), codecs_(codecs) {}
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
        const bool floats = pictures.image.view.type == PixelType::f32;
        std::vector<std::string> names;
        const auto put = [&](const std::string& name, const Picture& picture) {
            codecs_.write_image(folder_ / name, picture);
            names.push_back(name);
        };
        put(frame.name + (floats ? ".tiff" : ".png"), pictures.image);
        put("masks/" + frame.name + ".png", pictures.mask);
        if (!pictures.overlay.empty()) put("overlays/" + frame.name + ".png", pictures.overlay);
        if (journal_) journal_->append({{frame.key, valid_pixels(pictures.mask.view)}}, names);
    }

    void keep() override {}
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
    Codecs& codecs_;
};

// One video; beside it NAME.masks.mkv, without loss, and NAME.overlay with its suffix.
//
// A video cannot be appended to. Frames go to parts in a folder with `.parts` behind the video's
// name; finish() copies the compressed frames of all parts into the videos, and removes the parts.
class VideoSink : public Sink {
   public:
    VideoSink(Path path, double rate, Journal* journal, Codecs& codecs, int part_frames)
        : path_(std::move(path)), parts_(path_.string() + ".parts"), rate_(rate), journal_(journal),
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
                !ours.count(inside(entry.path().filename().string())))
                others.push_back(entry.path());
        for (const Path& file : others) fs::remove(file);
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
                open_.push_back({name, codecs_.open_part(parts_ / name, target, *image, rate_)});
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
        const auto open = std::exchange(open_, {});
        if (frames.empty()) return;
        std::vector<std::string> names;
        for (const Part& part : open) {
            part.writer->close(static_cast<int>(frames.size()));
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
        std::vector<std::string> names;
        for (std::size_t i = 0; i < units[0].files.size(); ++i) {
            const std::string kind =
                Path(units[0].files[i].first).filename().string().substr(frames[0].key.size());
            std::vector<std::pair<Path, int>> parts;
            for (const Unit& unit : units)
                parts.emplace_back(path_.parent_path() / unit.files.at(i).first,
                                   static_cast<int>(unit.frames.size()));
            codecs_.join(parts, beside(kind), rate_, check);
            names.push_back(beside(kind).filename().string());
        }
        note(std::move(all), names);
        std::error_code ignored;
        fs::remove_all(parts_, ignored);
    }

   private:
    struct Part {
        std::string name;
        std::unique_ptr<PartWriter> writer;
    };

    Path beside(const std::string& suffix) const {
        return Path(path_).replace_filename(path_.stem().string() + suffix);
    }
    std::string inside(const std::string& part) const {
        return parts_.filename().string() + "/" + part;
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

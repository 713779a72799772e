#include "sink.hpp"

#include <unistd.h>

#include <map>
#include <opencv2/videoio.hpp>

#include "files.hpp"

namespace xcalib::cli {
namespace {

namespace fs = std::filesystem;

const std::map<std::string, std::string> kCodecs = {
    {".mp4", "mp4v"}, {".avi", "MJPG"}, {".mkv", "FFV1"}};

std::string kind_of(const cv::Mat& image) {
    const char* type = image.depth() == CV_8U    ? "uint8"
                       : image.depth() == CV_16U ? "uint16"
                                                 : "float32";
    return std::string(type) + (image.channels() == 1 ? " gray" : " colour");
}

class FolderSink : public Sink {
   public:
    explicit FolderSink(Path folder) : folder_(std::move(folder)) {}
    bool concurrent() const override { return true; }
    void write(const std::string& name, const Registered& frame) override {
        const bool floats = frame.image.depth() == CV_32F;
        write_image(folder_ / (name + (floats ? ".tiff" : ".png")), frame.image);
        write_image(folder_ / "masks" / (name + ".png"), frame.mask);
        if (!frame.overlay.empty())
            write_image(folder_ / "overlays" / (name + ".png"), frame.overlay);
    }

   private:
    Path folder_;
};

// One video; beside it NAME.masks.mkv, without loss, and NAME.overlay with its suffix. .mp4 and
// .avi hold 8-bit images, compressed with loss; .mkv holds 8-bit and 16-bit gray images without
// loss (FFV1). No video holds float32 or 16-bit colour, nor odd sizes: OpenCV cuts those.
class VideoSink : public Sink {
   public:
    VideoSink(Path path, double rate) : path_(std::move(path)), rate_(rate) {}
    ~VideoSink() override {
        for (auto& [target, file] : files_) {
            file.writer.release();
            std::error_code ignored;
            fs::remove(file.partial, ignored);
        }
    }
    bool concurrent() const override { return false; }
    void write(const std::string&, const Registered& frame) override {
        put(path_, frame.image);
        put(Path(path_).replace_extension(".masks.mkv"), frame.mask);
        if (!frame.overlay.empty())
            put(Path(path_).replace_extension(".overlay" + path_.extension().string()),
                frame.overlay);
    }
    void close() override {
        for (auto& [target, file] : files_) {
            file.writer.release();
            fs::rename(file.partial, target);
        }
    }

   private:
    struct File {
        Path partial;
        cv::VideoWriter writer;
        cv::Size size;
        int type;
    };

    void put(const Path& path, const cv::Mat& image) {
        auto found = files_.find(path);
        if (found == files_.end()) found = files_.emplace(path, opened(path, image)).first;
        // OpenCV would leave out, or misread, what is not like the first frame.
        if (image.size() != found->second.size || image.type() != found->second.type)
            throw InputError(path.string() + ": a frame is " + size_text(image) + " " +
                             kind_of(image) +
                             ", unlike the first; a video holds frames of one kind, a folder any");
        found->second.writer.write(image);
    }

    File opened(const Path& path, const cv::Mat& image) const {
        const std::string suffix = lower_suffix(path);
        const bool deep = image.type() == CV_16UC1 && suffix == ".mkv";
        if (image.depth() != CV_8U && !deep)
            throw InputError(path.string() + ": the images are " + kind_of(image) + "; " + suffix +
                             " holds uint8" + (suffix == ".mkv" ? " and gray uint16" : "") +
                             ", a folder holds any");
        if (image.cols % 2 || image.rows % 2)
            throw InputError(path.string() + ": the images are " + size_text(image) +
                             "; a video holds even sizes, a folder any");
        if (path.has_parent_path()) fs::create_directories(path.parent_path());
        Path partial = path;
        partial.replace_filename("." + path.stem().string() + "." + std::to_string(getpid()) +
                                 ".partial" + path.extension().string());
        const std::string& codec = kCodecs.at(suffix);
        File file{partial, {}, image.size(), image.type()};
        std::vector<int> properties{cv::VIDEOWRITER_PROP_IS_COLOR, image.channels() == 3};
        // OpenCV 4.6 does not know of depths, and so refuses 16 bits.
        if (deep) properties.insert(properties.end(), {cv::VIDEOWRITER_PROP_DEPTH, CV_16U});
        file.writer.open(partial.string(), cv::CAP_FFMPEG,
                         cv::VideoWriter::fourcc(codec[0], codec[1], codec[2], codec[3]), rate_,
                         image.size(), properties);
        if (!file.writer.isOpened())
            throw InputError(path.string() + ": this OpenCV cannot write " + codec + " video of " +
                             kind_of(image) + " images");
        return file;
    }

    Path path_;
    double rate_;
    std::map<Path, File> files_;
};

}  // namespace

bool is_video_output(const Path& output) {
    return kCodecs.count(lower_suffix(output)) && !fs::is_directory(output);
}

std::unique_ptr<Sink> open_sink(const Path& output, double rate) {
    if (is_video_output(output)) return std::make_unique<VideoSink>(output, rate);
    return std::make_unique<FolderSink>(output);
}

}  // namespace xcalib::cli

#include "video.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <opencv2/videoio.hpp>

#include "xcalib/stream/video_length.hpp"

namespace xcalib::cli {
namespace {

// Frames ahead that are reached by decoding on rather than by seeking.
constexpr int kFew = 64;

// FFmpeg's 16-bit little-endian gray: "Y1", 0, 16.
constexpr std::uint32_t kGray16 = 0x10003159;

class Video : public Stream {
   public:
    explicit Video(Path path) : path_(std::move(path)) {
        open();
        const double format = capture_.get(cv::CAP_PROP_CODEC_PIXEL_FORMAT);
        gray_ = holds_gray(format);
        deep_ = gray_ && static_cast<std::int64_t>(format) == kGray16;
        // Anything, of a damaged file.
        const double announced = std::clamp(capture_.get(cv::CAP_PROP_FRAME_COUNT), 0.0, 1e9);
        while (capture_.grab()) frame_times_.push_back(capture_.get(cv::CAP_PROP_POS_MSEC) / 1e3);
        const double rate = capture_.get(cv::CAP_PROP_FPS);
        said = video_line(path_.string(), frame_times_, announced, rate);
        bool rising = true;
        for (std::size_t i = 1; i < frame_times_.size(); ++i)
            rising = rising && frame_times_[i] > frame_times_[i - 1];
        if (rising) times = frame_times_;
        restart();
    }
    int size() const override { return static_cast<int>(frame_times_.size()); }
    std::string name(int index) const override { return six_digits(index); }
    std::string where(int index) const override {
        return path_.string() + " frame " + std::to_string(index);
    }
    Path file(int) const override { return path_; }

   private:
    void open() {
        try {
            capture_.open(path_.string(), cv::CAP_FFMPEG);
        } catch (const cv::Exception&) {
        }
        if (!capture_.isOpened())
            throw InputError(path_.string() + ": cannot decode frame 0, truncated or not a video");
        // As with images: the geometry is that of the sensor, whatever a tag says of turning it.
        capture_.set(cv::CAP_PROP_ORIENTATION_AUTO, 0);
    }

    void restart() {
        capture_.release();
        open();
        if (gray_) capture_.set(cv::CAP_PROP_CONVERT_RGB, 0);
        next_ = 0;
    }

    Picture read(int index) override {
        // Two halves, or a slower partner, ask for the same frame again.
        if (last_ != index) {
            last_image_ = decoded(index);
            last_ = index;
        }
        return picture_of(last_image_);
    }

    // Frames come by decoding on; what lies elsewhere by seeking, believed only if the frame that
    // comes has the time of the one wanted, else by decoding from the start.
    cv::Mat decoded(int index) {
        last_ = -1;
        const int ahead = index - next_;
        if (!((ahead >= 0 && ahead <= kFew) || seek(index))) restart();
        for (; next_ <= index; ++next_)
            if (!capture_.grab()) {
                next_ = size();  // nowhere known: the next frame is sought anew
                throw DecodeError(where(index) + ": cannot decode, truncated or changed");
            }
        cv::Mat image;
        if (!capture_.retrieve(image)) throw DecodeError(where(index) + ": cannot decode");
        if (gray_ && image.channels() == 3) {
            // OpenCV before 4.8 turns gray to colour all the same, 8 bits of it.
            if (deep_)
                throw InputError(path_.string() +
                                 ": 16-bit gray, of which this OpenCV decodes 8 bits; the Python"
                                 " command, `xcalib`, reads all, and folders of images do here");
            cv::extractChannel(image, image, 0);
        }
        return image.clone();
    }

    // Goes to before a frame; false where the file does not lead there.
    bool seek(int index) {
        if (!times || index == 0) return false;
        // To the frame before it: the time of the frame grabbed there shows where we are.
        capture_.set(cv::CAP_PROP_POS_FRAMES, index - 1);
        if (!capture_.grab()) return false;
        const double time = capture_.get(cv::CAP_PROP_POS_MSEC) / 1e3;
        next_ = index;
        return std::abs(time - (*times)[static_cast<std::size_t>(index - 1)]) < 1e-6;
    }

    Path path_;
    cv::VideoCapture capture_;
    bool gray_ = false, deep_ = false;
    std::vector<double> frame_times_;
    int next_ = 0, last_ = -1;
    cv::Mat last_image_;
};

}  // namespace

bool holds_gray(double format_code) {
    const auto code = static_cast<std::uint32_t>(static_cast<std::int64_t>(format_code));
    for (const char* gray : {"Y800", "GREY", "Y16 "}) {
        std::uint32_t known = 0;
        std::memcpy(&known, gray, 4);
        if (code == known) return true;
    }
    return code == kGray16;
}

StreamPointer open_video(const Path& path) { return std::make_shared<Video>(path); }

}  // namespace xcalib::cli

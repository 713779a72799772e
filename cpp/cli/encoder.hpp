// Videos written through FFmpeg's libraries: encoded, checked, and joined without decoding.
//
// OpenCV writes videos too, but tells of no error (a full disk leaves half a video behind), cannot
// copy compressed frames from one file to another, and before 4.8 knows no gray of 16 bits.
#pragma once

#include <functional>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

#include "pictures.hpp"

namespace xcalib::cli {

inline const std::vector<std::string> kVideoOutputs = {".mp4", ".avi", ".mkv"};

// The library that compresses, and its version: parts of a video are of one.
std::string encoder_name();

// Throws InputError if a video of this name cannot hold the image: .mp4 and .avi hold 8-bit images,
// compressed with loss; .mkv holds 8-bit and 16-bit gray images without loss (FFV1). No video holds
// float32 or 16-bit colour, nor odd sizes.
void check_video_image(const Path& target, const cv::Mat& image);

// Compresses frames into a part of a video: a Matroska file, whole once it is closed; else nothing
// is left behind.
class Encoder {
   public:
    // `target`: the video it becomes a part of; its suffix says the codec, and messages name it.
    // `first`: an image like all that follow. `rate`: frames a second.
    Encoder(Path path, Path target, const cv::Mat& first, double rate);
    ~Encoder();

    const Path& path() const { return path_; }
    void write(const cv::Mat& image);
    // Throws where the file does not hold at least `frames` frames then.
    void close(int frames);

   private:
    struct State;
    void mux(const cv::Mat* image);  // none: what is still to come

    Path path_, target_, partial_;
    std::unique_ptr<State> state_;
};

// Writes a video, whole or not at all, of the compressed frames of its parts: files of Encoder, and
// how many frames to take of each. Until it is whole it is with the parts. `check` is called for
// every frame; what it throws ends the writing.
void join_videos(const std::vector<std::pair<Path, int>>& parts, const Path& target, double rate,
                 const std::function<void()>& check);

}  // namespace xcalib::cli

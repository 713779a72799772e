// Where registered frames go: a folder of images, or a video.
#pragma once

#include <memory>
#include <opencv2/core.hpp>

#include "pictures.hpp"

namespace xcalib::cli {

struct Registered {
    cv::Mat image, mask;
    cv::Mat overlay;  // empty: not asked for
};

class Sink {
   public:
    virtual ~Sink() = default;
    virtual bool concurrent() const = 0;  // may frames come in any order, from several threads?
    virtual void write(const std::string& name, const Registered& frame) = 0;
    // Without it what was made is thrown away, where it is one file.
    virtual void close() {}
};

bool is_video_output(const Path& output);

// A video where the suffix says so, at `rate` frames a second; else a folder: images under the
// names of the frames, masks/ and overlays/ beside them.
std::unique_ptr<Sink> open_sink(const Path& output, double rate);

}  // namespace xcalib::cli

// Where registered frames go: a folder of images, or a video. Both note in a journal what is whole,
// and so can go on from where an earlier run ended.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <opencv2/core.hpp>

#include "journal.hpp"
#include "pictures.hpp"

namespace xcalib::cli {

struct Registered {
    cv::Mat image, mask;
    cv::Mat overlay;  // empty: not asked for
};

// What a frame is called, and its key, which changes with what it is made of.
struct FrameName {
    std::string key, name;
};

long valid_pixels(const cv::Mat& mask);

// Destroyed, it keeps what is whole, whatever happened; finish() completes it.
class Sink {
   public:
    virtual ~Sink() = default;
    virtual bool concurrent() const = 0;  // may frames come in any order, from several threads?
    // Before the first frame: all frames, in order. Returns the keys of those that are there
    // already, with the valid pixels of each.
    virtual std::map<std::string, long> begin(const std::vector<FrameName>& frames) = 0;
    virtual void write(int index, const FrameName& frame, const Registered& pictures) = 0;
    // After the last frame; `check` is called now and then, and may throw.
    virtual void finish(const std::vector<FrameName>& frames,
                        const std::function<void()>& check) = 0;
};

bool is_video_output(const Path& output);

// In the folder, or beside the video and named after it.
Path journal_of(const Path& output);

// A video where the suffix says so, at `rate` frames a second; else a folder: images under the
// names of the frames, masks/ and overlays/ beside them. `journal`: may be null where a run is not
// to be taken up again.
std::unique_ptr<Sink> open_sink(const Path& output, double rate, Journal* journal);

}  // namespace xcalib::cli

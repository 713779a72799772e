// What footage is, wherever it comes from.
#pragma once

#include <memory>
#include <mutex>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "pictures.hpp"
#include "xcalib/footage/pairing.hpp"

namespace xcalib::cli {

// Frames of one size, each read at the moment of access. Only names and times are held, so that
// memory does not grow with the pixels of the footage.
class Stream {
   public:
    virtual ~Stream() = default;

    virtual int size() const = 0;
    virtual std::string name(int index) const = 0;   // of a file made from the frame, no suffix
    virtual std::string where(int index) const = 0;  // for messages
    virtual Path file(int index) const = 0;          // that the frame is in
    virtual std::vector<Path> paths() const { return {}; }  // where frames are files
    virtual bool concurrent() const { return false; }       // may several threads read?
    // [s] of the frames on the clock of this stream, never falling; none where unknown.
    std::optional<std::vector<double>> times;

    // Frame `index`; throws InputError where it is not of the size of the others.
    cv::Mat operator[](int index);

    FrameList frames() const;

   private:
    virtual cv::Mat read(int index) = 0;

    std::mutex mutex_;
    std::string first_;  // read, and its size
    cv::Size size_;
};

using StreamPointer = std::shared_ptr<Stream>;

// The name of a frame that has none of its own: 000007.
std::string six_digits(int index);

// A list of image files; their times stand in their names or in a table beside them.
class ImageFiles : public Stream {
   public:
    explicit ImageFiles(std::vector<Path> paths);
    int size() const override { return static_cast<int>(paths_.size()); }
    std::string name(int index) const override { return at(index).stem().string(); }
    std::string where(int index) const override { return at(index).string(); }
    Path file(int index) const override { return at(index); }
    std::vector<Path> paths() const override { return paths_; }
    bool concurrent() const override { return true; }

   private:
    cv::Mat read(int index) override { return read_image(at(index)); }
    const Path& at(int index) const { return paths_[static_cast<std::size_t>(index)]; }

    std::vector<Path> paths_;
};

// Some frames of a stream.
class Picked : public Stream {
   public:
    Picked(StreamPointer stream, std::vector<int> indices);
    int size() const override { return static_cast<int>(indices_.size()); }
    std::string name(int index) const override { return stream_->name(at(index)); }
    std::string where(int index) const override { return stream_->where(at(index)); }
    Path file(int index) const override { return stream_->file(at(index)); }
    bool concurrent() const override { return stream_->concurrent(); }

   private:
    cv::Mat read(int index) override { return (*stream_)[at(index)]; }
    int at(int index) const { return indices_[static_cast<std::size_t>(index)]; }

    StreamPointer stream_;
    std::vector<int> indices_;
};

// What REFERENCE or SOURCE names: a folder of images; a pattern (`shots/*.png`, `shots/%06d.png`);
// a TIFF stack; a video. `#left`, `#right`, `#top` or `#bottom` behind any of them takes that half
// of each frame. A path that exists is taken as it is, whatever is in its name.
StreamPointer open_stream(const std::string& spec);

// Times of a stream from a table of `name timestamp` lines.
std::vector<double> read_times(const Path& table, const Stream& stream);

// The stream with false colour turned back to numbers, by `colormap` (auto, none, or a name), and a
// line that says so in `said`.
StreamPointer scalar_sources(StreamPointer sources, const std::string& colormap, std::string& said);

}  // namespace xcalib::cli

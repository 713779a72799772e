// What footage is, wherever it comes from.
#pragma once

#include <array>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "xcalib/export.hpp"
#include "xcalib/footage/pairing.hpp"
#include "xcalib/stream/header.hpp"
#include "xcalib/stream/picture.hpp"

namespace XCALIB_EXPORT xcalib {

// Frames of one size, each read at the moment of access. Only names and times are held, so that
// memory does not grow with the pixels of the footage.
class Stream {
   public:
    virtual ~Stream() = default;

    virtual int size() const = 0;
    virtual std::string name(int index) const = 0;   // of a file made from the frame, no suffix
    virtual std::string where(int index) const = 0;  // for messages
    // That the frame is in, or the folder of many such files.
    virtual std::filesystem::path file(int index) const { return where(index); }
    virtual std::vector<std::filesystem::path> paths() const {
        return {};
    }                                                  // frames that are files
    virtual bool concurrent() const { return false; }  // may several threads read, in any order?
    // [s] of the frames on the clock of this stream, never falling; none where unknown.
    std::optional<std::vector<double>> times;
    // For the user: what of it was not used, or is missing, in a line, or nothing.
    std::string said;

    // Frame `index`, 0 <= index < size(); throws InputError where it is not of the size of the
    // others, DecodeError where it cannot be decoded.
    Picture operator[](int index);
    // A picture of its size, for those who do not look at its pixels, which are 0: where a header
    // tells the size, nothing is decoded, and what is corrupt behind it is not found.
    Picture outline(int index);
    // The size of the frame where it is known without decoding it.
    virtual std::optional<HeaderSize> size_in_header(int) { return std::nullopt; }

    FrameList frames() const;

   private:
    virtual Picture read(int index) = 0;
    void require_one_size(int index, const ImageView& image);

    std::mutex mutex_;
    int first_ = -1;        // the frame read first
    ImageView first_size_;  // of which only the size is known
    Picture outline_;       // of all of them
};

using StreamPointer = std::shared_ptr<Stream>;

// Some frames of a stream, in the order of the indices.
class Picked : public Stream {
   public:
    Picked(StreamPointer stream, std::vector<int> indices);
    int size() const override { return static_cast<int>(indices_.size()); }
    std::string name(int index) const override { return stream_->name(at(index)); }
    std::string where(int index) const override { return stream_->where(at(index)); }
    std::filesystem::path file(int index) const override { return stream_->file(at(index)); }
    bool concurrent() const override { return stream_->concurrent(); }
    std::optional<HeaderSize> size_in_header(int index) override {
        return stream_->size_in_header(at(index));
    }

   private:
    Picture read(int index) override { return (*stream_)[at(index)]; }
    int at(int index) const { return indices_[static_cast<std::size_t>(index)]; }

    StreamPointer stream_;
    std::vector<int> indices_;
};

// The stream itself where all its frames are picked, in order.
StreamPointer picked(StreamPointer stream, const std::vector<int>& indices);

// The frames of another stream, read in another way.
class Wrapped : public Stream {
   public:
    int size() const override { return stream_->size(); }
    std::string name(int index) const override { return stream_->name(index); }
    std::string where(int index) const override { return stream_->where(index); }
    std::filesystem::path file(int index) const override { return stream_->file(index); }
    bool concurrent() const override { return stream_->concurrent(); }

   protected:
    explicit Wrapped(StreamPointer stream) : stream_(std::move(stream)) {
        times = stream_->times;
        said = stream_->said;
    }

    StreamPointer stream_;
};

// A stream whose frames are passed through a function as they are read.
class Converted : public Wrapped {
   public:
    using Convert = std::function<Picture(const Picture&, int index)>;

    Converted(StreamPointer stream, Convert convert)
        : Wrapped(std::move(stream)), convert_(std::move(convert)) {}

   private:
    Picture read(int index) override { return convert_((*stream_)[index], index); }

    Convert convert_;
};

inline constexpr std::array<const char*, 4> kHalves = {"left", "right", "top", "bottom"};

// A half of every frame, one of kHalves: two cameras side by side, or one above the other, in one
// stream.
class Half : public Converted {
   public:
    Half(StreamPointer stream, std::string half);
    std::string where(int index) const override {
        return stream_->where(index) + " (" + half_ + " half)";
    }

   private:
    std::string half_;
};

// Times of a stream from a table of `name timestamp` lines, see times_of_table().
std::vector<double> read_times(const std::filesystem::path& table, const Stream& stream);

// Those of timestamps.csv or timestamps.txt beside the files of a stream, where there is one. A
// table without names that has more or fewer lines is another's: `said` says that it is not used.
std::optional<std::vector<double>> times_beside(const std::vector<std::filesystem::path>& files,
                                                const Stream& stream, std::string& said);

// The stream with false colour turned back to numbers, by `colormap` (auto, none, or a name), and a
// line that says so in `said`. auto reads a few frames.
StreamPointer scalar_sources(StreamPointer sources, const std::string& colormap, std::string& said);

// The name of a frame that has none of its own: 000007.
std::string six_digits(int index);

}  // namespace xcalib

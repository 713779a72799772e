// Where registered frames go: a folder of images, or a video. Both note in a journal what is whole,
// and so can go on from where an earlier run ended.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "xcalib/export.hpp"
#include "xcalib/stream/journal.hpp"
#include "xcalib/stream/picture.hpp"

namespace XCALIB_EXPORT xcalib {

// -- What compresses ------------------------------------------------------------------------------

// Compresses frames into a part of a video.
class PartWriter {
   public:
    virtual ~PartWriter() = default;
    virtual void write(const Picture& image) = 0;
    // Throws where the file does not hold at least `frames` frames then.
    virtual void close(int frames) = 0;
};

// What the library that does the work is asked for. Errors of files are std::system_error with the
// path that messages are to name. Files are written by the names they are given, which are not yet
// those of the output: what becomes of them is for the sink. `target` is the video that a part
// becomes a part of: its suffix says the codec, and messages name it. Rates are in frames a second.
class Codecs {
   public:
    virtual ~Codecs() = default;

    // An image file of the kind that the suffix says, .png or .tiff. From any thread.
    virtual std::string encode_image(const std::filesystem::path& file, const Picture& image) = 0;

    // The library that compresses videos, and its version: parts of a video are of one.
    virtual std::string encoder_name() = 0;
    // `first`: an image like all that follow.
    virtual std::unique_ptr<PartWriter> open_part(const std::filesystem::path& file,
                                                  const std::filesystem::path& target,
                                                  const Picture& first, double rate) = 0;
    // Writes a video of the compressed frames of its parts, and how many to take of each. `check`
    // is called for every frame; what it throws ends the writing.
    virtual void join(const std::vector<std::pair<std::filesystem::path, int>>& parts,
                      const std::filesystem::path& file, const std::filesystem::path& target,
                      double rate, const std::function<void()>& check) = 0;
};

// -- Sinks ----------------------------------------------------------------------------------------

struct Registered {
    Picture image, mask;
    Picture overlay;  // empty: not asked for
};

long valid_pixels(const ImageView& mask);

// What a frame is called, and its key, which changes with what it is made of.
struct FrameName {
    std::string key, name;
};

class Sink {
   public:
    virtual ~Sink() = default;            // keeps what it can where keep() was not called
    virtual bool concurrent() const = 0;  // may frames come in any order, from several threads?
    // Before the first frame: all frames, in order. Returns the keys of those that are there
    // already, with the valid pixels of each.
    virtual std::map<std::string, long> begin(const std::vector<FrameName>& frames) = 0;
    virtual void write(int index, const FrameName& frame, const Registered& pictures) = 0;
    // After the last frame of a run that does not finish: all that came is whole, and noted.
    virtual void keep() = 0;
    // After the last frame of all; `check` is called now and then, and may throw.
    virtual void finish(const std::vector<FrameName>& frames,
                        const std::function<void()>& check) = 0;
};

// By the suffix, where there is no folder of that name.
bool is_video_output(const std::filesystem::path& output);

// In the folder, or beside the video and named after it.
std::filesystem::path journal_of(const std::filesystem::path& output);

// Throws InputError if a video of this name cannot hold the image: .mp4 and .avi hold 8-bit images,
// compressed with loss; .mkv holds 8-bit and 16-bit gray images without loss. No video holds
// float32 or 16-bit colour, nor odd sizes.
void check_video_image(const std::filesystem::path& target, const ImageView& image);

// Frames that a run that is killed, not only interrupted, can lose of a video at most, and of a
// folder: so many go to the disk together.
inline constexpr int kPartFrames = 250;
inline constexpr int kBatchFrames = 32;

// The files of an output, of frames of these names: those that a run may write to.
std::vector<std::string> output_files(const std::filesystem::path& output,
                                      const std::vector<FrameName>& frames, bool overlays);
// The folders that are filled with images; none of a video.
std::vector<std::filesystem::path> output_folders(const std::filesystem::path& output,
                                                  bool overlays);

// Throws InputError where one of these files is there though the journal of the output is new:
// others have made it.
void check_not_others(const std::filesystem::path& output, const std::vector<std::string>& files);
// Throws InputError where another video's run has a file beside it that this one's has too: o.mp4
// and o.avi both have o.masks.mkv.
void check_alone(const std::filesystem::path& output);

// Makes a video of the parts that a live run has left, which was killed or could not end; returns
// how many frames it has. `check` is called for every frame, and may throw. Throws InputError where
// there is no such run.
int join_parts(const std::filesystem::path& output, Codecs& codecs,
               const std::function<void()>& check);

// A video where the suffix says so, at `rate` frames a second, in parts of `part_frames`; else a
// folder: images under the names of the frames, masks/ and overlays/ beside them. `journal`: may be
// null where a run is not to be taken up again. Both are to outlive the sink.
std::unique_ptr<Sink> open_sink(const std::filesystem::path& output, double rate, Journal* journal,
                                Codecs& codecs, int part_frames = kPartFrames);

}  // namespace xcalib

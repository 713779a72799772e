// Paired frames with their depth, and those of them that a calibration loads.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "xcalib/export.hpp"
#include "xcalib/footage/sequence.hpp"
#include "xcalib/stream/stream.hpp"

namespace XCALIB_EXPORT xcalib {

// Depth of the reference frames, wherever it comes from.
class Depth {
   public:
    virtual ~Depth() = default;

    // The depth of frame `index`, whose reference image is given: one channel, float32 [m], 0
    // unknown, any size of the reference's aspect.
    virtual Picture operator()(int index, const Picture& reference) = 0;
    virtual std::vector<std::filesystem::path> files(int) const { return {}; }  // it is made from
    virtual bool concurrent() const { return false; }  // may several threads ask, in any order?
    // Whether a frame's depth is made of those before it too.
    virtual bool steadied() const { return false; }
    // Does it depend on the reference's pixels, or on its size alone?
    virtual bool looks_at_reference() const { return true; }
    // For the user: what its numbers are taken for, in a line, or nothing.
    virtual std::string line() const { return ""; }
};

using DepthPointer = std::shared_ptr<Depth>;

struct Frame {
    Picture reference, source, depth;
};

// Opened, but not read.
struct Frames {
    StreamPointer references, sources;  // as many of both
    DepthPointer depth;
    StreamPointer all_sources = nullptr;  // with those that have no partner; null: not known
    std::vector<int> partners = {};       // of the references, among them
    TimeOffset offset = {};               // that they were paired with

    int size() const { return references->size(); }
    Frame read(int index) const;
};

// The frames with the sources `lag` frames later, without those that have none; `chosen`, of the
// frames, becomes the same references' indices.
Frames with_lag(const Frames& frames, int lag, std::vector<int>& chosen);

// Frames in memory.
struct LoadedFrames {
    std::vector<int> indices;  // of the frames that could be decoded
    std::vector<Frame> frames;
    int failures = 0;           // frames that could not
    std::string first_failure;  // why the first of them could not

    std::vector<ImageView> views(Picture Frame::*kind) const;
};

// The chosen frames, without those that cannot be decoded; `progress` is called after each of
// either kind, and may throw. Throws DecodeError of the first where there is no other.
LoadedFrames load_frames(const Frames& frames, const std::vector<int>& chosen,
                         const std::function<void(int done)>& progress);

// The warning that frames were left out of a calibration, and why the first was.
std::string left_out(std::size_t count, const std::string& first);

// A message of the core, which sees pixels only, with the file that it calls `frame N`: one of the
// `chosen` frames of `images`.
std::string with_file_name(const std::string& message, const Stream& images,
                           const std::vector<int>& chosen);

}  // namespace xcalib

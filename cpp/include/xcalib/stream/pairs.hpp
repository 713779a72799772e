// Two streams, and which of their frames belong together.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "xcalib/camera.hpp"
#include "xcalib/export.hpp"
#include "xcalib/footage/clock_offset.hpp"
#include "xcalib/footage/sequence.hpp"
#include "xcalib/stream/frames.hpp"

namespace XCALIB_EXPORT xcalib {

// How to pair two streams: pair_frames(), and where times come from.
struct Matching {
    std::string method = "auto";
    TimeOffset offset = {};
    std::optional<double> max_gap;  // [s]; none: half the slower stream's period
    std::filesystem::path reference_times, source_times;  // of read_times(); empty: the stream's
};

// Depth of some of the reference frames, by their indices.
using OpenDepth = std::function<DepthPointer(const std::vector<int>& used)>;

class Pairs {
   public:
    // Nothing but times is read, save that an offset to be estimated, unless there is an
    // `estimate`, needs the frames. Throws InputError where frames cannot be paired.
    Pairs(StreamPointer references, StreamPointer sources, const Matching& matching,
          std::optional<OffsetEstimate> estimate = std::nullopt);

    // Pairs anew with the offset at which frames register best with the rig, refine_offset().
    // Without an estimated offset the pairs stay as they are, and so they do where the registered
    // frames tell neither around the estimate nor around 0. Sequences without times are looked at
    // up to 6 frames either way.
    void refine(const Rig& rig, const OpenDepth& open_depth);

    StreamPointer references() const { return picked(all_references_, pairing_.references); }
    StreamPointer sources() const { return picked(all_sources_, pairing_.sources); }

    const StreamPointer& all_references() const { return all_references_; }
    const StreamPointer& all_sources() const { return all_sources_; }
    const FrameList& reference_list() const { return reference_list_; }  // of all of them
    const Pairing& pairing() const { return pairing_; }
    std::vector<std::string> notes() const;  // for the user, a line each

    // That they are paired with.
    TimeOffset offset() const {
        return {matching_.offset.automatic, pairing_.offset, pairing_.lag};
    }

   private:
    void refine_frames(const Rig& rig, const OpenDepth& open_depth);
    RefinedOffset refined(double guess, const Rig& rig, const OpenDepth& open_depth) const;

    StreamPointer all_references_, all_sources_;
    Matching matching_;
    FrameList reference_list_, source_list_;
    std::optional<OffsetEstimate> estimate_;
    Pairing pairing_;
    std::vector<std::string> notes_;
};

// The estimates of clock_offset.hpp on streams, which must have times; frames that cannot be
// decoded are left out.
OffsetEstimate estimate_offset(Stream& references, Stream& sources, double max_offset = 2.0,
                               int max_frames = 1500);
std::vector<double> offsets_around(double guess, const Stream& references, const Stream& sources);
RefinedOffset refine_offset(const Rig& rig, Stream& references, Stream& sources, Depth& depth,
                            const std::vector<double>& candidates, int max_frames = 12);

}  // namespace xcalib

// From a rig to registered frames on disk: decode, depth, warp and encode at the same time.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "xcalib/camera.hpp"
#include "xcalib/export.hpp"
#include "xcalib/register.hpp"
#include "xcalib/stream/frames.hpp"
#include "xcalib/stream/sink.hpp"
#include "xcalib/stream/stages.hpp"

namespace XCALIB_EXPORT xcalib {

struct RegistrationOptions {
    // Its num_threads are those of the whole run; with 1 nothing overlaps.
    RegistrarOptions registrar;
    bool overlays = false;
    bool overwrite = false;  // start again where an earlier run has written
    int part_frames = kPartFrames;
    double rate = 0.0;  // of a video [frames/s]; 0: that of the references
};

// Of a video of these frames [frames/s]: by the median of their times; 25 where they have none.
double frame_rate(const Stream& references);

// How far a stream is registered, and its totals.
struct Registration {
    int frames = 0;
    int earlier = 0;       // of these, that were there from an earlier run
    int made = 0;          // that this run has made
    long valid = 0;        // pixels of the frames of either
    long pixels = 0;       // of all frames
    long not_finite = 0;   // source pixels of the frames of this run that are no number
    double seconds = 0.0;  // that this run took so far
    BusyShares busy;       // of its stages

    double speed() const;  // [frames/s] of this run
    // While it is under way; how long it may still take is as those made so far took.
    std::string line() const;
    std::string summary() const;
};

// One frame on the reference grid; `overlay`: with a picture of both.
Registered registered(const Registrar& registrar, const Picture& reference, const Picture& source,
                      const Picture& depth, bool overlay);

// The name of each frame, and its key, which changes with the files that it is made of: their
// names, sizes, times. Depth that depends on the frames before makes the key depend on them as
// well.
std::vector<FrameName> frame_names(const Frames& frames);

// What a run of register_frames() has before its first frame, and all that one needs who has frames
// registered elsewhere: nothing that is read is written to, nobody else is at the output, and what
// an earlier run has written is known. Arguments as those of register_frames().
struct BegunRegistration {
    BegunRegistration(const Frames& frames, const Rig& rig, const std::filesystem::path& output,
                      const RegistrationOptions& options, const std::string& command,
                      const MadeWith& inputs, const std::vector<std::filesystem::path>& other_reads,
                      Codecs& codecs);

    std::vector<FrameName> names;       // of all frames
    Rig sized;                          // for the images
    MadeWith made_with;                 // that the journal says
    std::unique_ptr<Journal> journal;   // held
    std::unique_ptr<Sink> sink;         // goes before the journal
    std::map<std::string, long> there;  // by key: valid pixels of the frames from before
};

// Registers all frames that an earlier run has not written. `command` names the caller, `inputs`
// are all else that it made `frames` with: an output of others is refused. `other_reads` are the
// files it read besides those of the frames: nothing that is read is written to. `progress` is
// called in the caller's thread after frames, and a few times a second, and may throw. Throws
// Interrupted on SIGINT or SIGTERM (interrupts.hpp); what is written then is whole, and the same
// call goes on from there.
Registration register_frames(const Frames& frames, const Rig& rig,
                             const std::filesystem::path& output,
                             const RegistrationOptions& options, const std::string& command,
                             const MadeWith& inputs,
                             const std::vector<std::filesystem::path>& other_reads, Codecs& codecs,
                             const std::function<void(const Registration&)>& progress);

}  // namespace xcalib

// Footage whose frames follow each other: videos, bags, names that are times, consecutive numbers.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "xcalib/export.hpp"
#include "xcalib/footage/pairing.hpp"

namespace XCALIB_EXPORT xcalib {

// When the frames of a sequence were taken.
struct FrameClock {
    std::vector<double> ticks;  // never falling
    double period = 1.0;        // median distance of frames [ticks]
    bool in_seconds = false;    // ticks are seconds, else frames
};

// The clock of a sequence: its times, or else the one number that changes from name to name. None
// where frames do not follow each other: times that are seconds apart, numbers that mostly rise by
// more than one, names of other kinds.
std::optional<FrameClock> clock_of(const FrameList& frames);

// The frame `lag` periods after each of `frames`, -1 where the footage has none.
std::vector<int> frames_later(const FrameClock& clock, const std::vector<int>& frames, int lag);

// The pairs of `pairing` with the sources `lag` frames later, without those that have none. Throws
// InputError, naming `sources`, where these are no sequence or no pair is left.
Pairing with_lag(const Pairing& pairing, const FrameList& sources, int lag);

// What `--time-offset` says.
struct TimeOffset {
    bool automatic = false;
    double seconds = 0.0;  // by which the source's clock is late
    int frames = 0;        // of the source, by which it is late
};

// `auto`, seconds (`0.1`), or frames of the source (`2f`). Throws InputError.
TimeOffset parse_time_offset(const std::string& text);

// The option for frames paired with `offset` whose sources turn out to be `lag` frames late.
std::string option_for_lag(const TimeOffset& offset, int lag, const FrameClock& clock);

std::string lateness(int lag);  // `2 frames late`, `1 frame early`

}  // namespace xcalib

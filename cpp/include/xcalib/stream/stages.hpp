// Frames through stages, several frames at the same time.
//
// A thread takes a frame through all of its stages, so that while one decodes another encodes, and
// no more frames are under way than there are threads. Stages in which frames depend on each other
// take them one by one, in order: there a thread waits for the frame before its own. Nothing can
// lock up: what is waited for never waits for what comes later.
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "xcalib/export.hpp"

namespace XCALIB_EXPORT xcalib {

// One step that every frame passes.
struct Stage {
    std::string name;
    bool in_order;  // one frame at a time, in their order; else any number, in any order
    // `frame` counts from 0; `slot`, from 0 to below the number of threads, is the frame's own as
    // long as it is under way.
    std::function<void(int frame, int slot)> run;
};

// By name, the share of the time in which a stage was at work, [0, 1]: of that of all threads, or,
// where it takes frames in order, of one; the busiest of one name. A stage near 1 is the one that
// the others wait for.
using BusyShares = std::vector<std::pair<std::string, double>>;

// Takes `count` frames through the stages, on `threads` threads besides the caller's. That one
// calls `progress` with the number of frames that are through, whenever it has grown and a few
// times a second; it may throw. An error, there or in a stage, ends all: no other frame is begun,
// those under way before the one that failed are finished, none after it gets past a stage that
// takes them in order, no thread is left. Of several errors that of the earliest frame is thrown;
// that of `progress` if no frame failed. On a request to end (interrupts.hpp) no other frame is
// begun either, and it is for `progress` to throw.
void run_stages(int count, const std::vector<Stage>& stages, int threads,
                const std::function<void(int done, const BusyShares& busy)>& progress);

}  // namespace xcalib

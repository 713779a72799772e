// What a run would do, for `--dry-run`.
#pragma once

#include <string>
#include <vector>

#include "xcalib/export.hpp"
#include "xcalib/stream/frames.hpp"

namespace XCALIB_EXPORT xcalib {

// The pairs, with the files of their depth, and those `chosen` to calibrate on where there are any,
// a line each; of long footage the first and the last.
std::string plan_text(const Frames& frames, const std::vector<int>& chosen);

}  // namespace xcalib

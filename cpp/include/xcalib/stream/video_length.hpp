// Whether a video is whole: containers only estimate how many frames they hold.
#pragma once

#include <string>
#include <vector>

#include "xcalib/export.hpp"

namespace XCALIB_EXPORT xcalib {

// A line where fewer frames were decoded than the header announces, though they reach to the end: a
// recording with pauses, or of a varying rate; else nothing. times [s]: of the frames decoded;
// rate [1/s]: as the header has it. Throws InputError where the file ends early.
std::string video_line(const std::string& name, const std::vector<double>& times, double announced,
                       double rate);

}  // namespace xcalib

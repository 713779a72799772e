// A blind choice of frames.
#pragma once

#include <cstdint>
#include <vector>

#include "xcalib/export.hpp"

namespace XCALIB_EXPORT xcalib {

// `max_frames` of `count` indices, spread over the whole, drawn with `seed`; sorted.
std::vector<int> draw_frames(int count, int max_frames, std::uint32_t seed);

}  // namespace xcalib

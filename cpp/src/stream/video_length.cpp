#include "xcalib/stream/video_length.hpp"

#include <cmath>

#include "base/format.hpp"
#include "xcalib/error.hpp"

namespace xcalib {

std::string video_line(const std::string& name, const std::vector<double>& times, double announced,
                       double rate) {
    const auto count = static_cast<double>(times.size());
    // Containers estimate their length to a frame or so.
    const bool all = count >= 0.99 * announced - 1;
    if (!times.empty() && all) return "";
    const double length = times.empty() ? 0 : times.back() - times.front();
    if (times.empty() || !(rate > 0) || length * rate + 1 < 0.99 * announced - 2)
        throw InputError(format("%s: cannot decode frame %zu of about %ld, truncated", name.c_str(),
                                times.size(), std::lround(announced)));
    return format(
        "%s: %zu frames in %.1f s, where its header says about %ld; a recording with pauses"
        " or of a varying rate, whose frames go by their own times",
        name.c_str(), times.size(), length, std::lround(announced));
}

}  // namespace xcalib

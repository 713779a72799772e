#include "xcalib/draw_frames.hpp"

#include <random>
#include <stdexcept>
#include <string>

namespace xcalib {

std::vector<int> draw_frames(int count, int max_frames, std::uint32_t seed) {
    if (count < 0 || max_frames < 1)
        throw std::invalid_argument("draw_frames: count = " + std::to_string(count) +
                                    " and max_frames = " + std::to_string(max_frames) +
                                    ", expected >= 0 and >= 1");
    std::vector<int> chosen;
    if (count <= max_frames) {
        for (int i = 0; i < count; ++i) chosen.push_back(i);
        return chosen;
    }
    // One from each of max_frames equal parts of the footage. The raw generator, since what the
    // standard's distributions draw differs between libraries.
    std::mt19937 generator(seed);
    for (int i = 0; i < max_frames; ++i) {
        const auto first = static_cast<std::int64_t>(count) * i / max_frames;
        const auto last = static_cast<std::int64_t>(count) * (i + 1) / max_frames;
        chosen.push_back(static_cast<int>(first + generator() % (last - first)));
    }
    return chosen;
}

}  // namespace xcalib

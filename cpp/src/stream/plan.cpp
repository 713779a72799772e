#include "xcalib/stream/plan.hpp"

namespace xcalib {

std::string plan_text(const Frames& frames, const std::vector<int>& chosen) {
    constexpr int kShown = 3;
    const int count = frames.size();
    std::string text = std::to_string(count) + (count == 1 ? " pair:" : " pairs:");
    for (int i = 0; i < count; ++i) {
        if (count > kShown + 2 && i == kShown) {
            text += "\n  ... " + std::to_string(count - kShown - 1) + " more, to";
            i = count - 1;
        }
        text += "\n  " + frames.references->where(i) + " + " + frames.sources->where(i);
        for (const auto& file : frames.depth->files(i)) text += ", depth " + file.string();
    }
    if (chosen.empty()) return text;
    text += "\nto calibrate on, " + std::to_string(chosen.size()) + ":";
    for (const int index : chosen) text += " " + frames.references->name(index);
    return text;
}

}  // namespace xcalib

#include "xcalib/stream/frames.hpp"

#include <regex>

#include "xcalib/error.hpp"

namespace xcalib {

Frame Frames::read(int index) const {
    Frame frame;
    frame.reference = (*references)[index];
    frame.source = (*sources)[index];
    frame.depth = (*depth)(index, frame.reference);
    return frame;
}

std::vector<ImageView> LoadedFrames::views(Picture Frame::*kind) const {
    std::vector<ImageView> list;
    for (const Frame& frame : frames) list.push_back((frame.*kind).view);
    return list;
}

LoadedFrames load_frames(const Frames& frames, const std::vector<int>& chosen,
                         const std::function<void(int done)>& progress) {
    LoadedFrames loaded;
    int done = 0;
    for (const int index : chosen) {
        try {
            loaded.frames.push_back(frames.read(index));
            loaded.indices.push_back(index);
        } catch (const DecodeError& error) {
            if (loaded.failures++ == 0) loaded.first_failure = error.what();
        }
        progress(++done);
    }
    if (!loaded.frames.empty()) return loaded;
    if (loaded.failures) throw DecodeError(loaded.first_failure);
    throw InputError("no frame to calibrate on");
}

std::string left_out(std::size_t count, const std::string& first) {
    return std::to_string(count) + " unusable " + (count == 1 ? "frame is" : "frames are") +
           " left out; " + first;
}

std::string with_file_name(const std::string& message, const Stream& images,
                           const std::vector<int>& chosen) {
    static const std::regex frame(R"(\bframe (\d{1,9})\b)");
    std::smatch found;
    if (!std::regex_search(message, found, frame)) return message;
    const std::size_t index = std::stoul(found[1]);
    if (index >= chosen.size()) return message;
    return message + " (frame " + found[1].str() + " is " + images.where(chosen[index]) + ")";
}

}  // namespace xcalib

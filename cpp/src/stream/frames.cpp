#include "xcalib/stream/frames.hpp"

#include <algorithm>
#include <numeric>
#include <regex>

#include "xcalib/error.hpp"

namespace xcalib {
namespace {

// Depth of some of the frames.
class PickedDepth : public Depth {
   public:
    PickedDepth(DepthPointer depth, std::vector<int> indices)
        : depth_(std::move(depth)), indices_(std::move(indices)) {}
    Picture operator()(int index, const Picture& reference) override {
        return (*depth_)(at(index), reference);
    }
    std::vector<std::filesystem::path> files(int index) const override {
        return depth_->files(at(index));
    }
    bool concurrent() const override { return depth_->concurrent(); }
    bool steadied() const override { return depth_->steadied(); }
    bool looks_at_reference() const override { return depth_->looks_at_reference(); }

   private:
    int at(int index) const { return indices_[static_cast<std::size_t>(index)]; }

    DepthPointer depth_;
    std::vector<int> indices_;
};

bool any_known(const ImageView& depth) {
    const Image metres = clean_depth(depth);
    return std::any_of(metres.pixels.begin(), metres.pixels.end(), [](float z) { return z > 0; });
}

}  // namespace

Frames with_lag(const Frames& frames, int lag, std::vector<int>& chosen) {
    std::vector<int> every(frames.partners.size());
    std::iota(every.begin(), every.end(), 0);
    Pairing now;
    now.references = every;
    now.sources = frames.partners;
    const Pairing later = with_lag(now, frames.all_sources->frames(), lag);
    Frames out = frames;
    out.partners = later.sources;
    out.sources = picked(frames.all_sources, later.sources);
    out.references = picked(frames.references, later.references);
    out.depth = std::make_shared<PickedDepth>(frames.depth, later.references);
    out.offset.frames += lag;
    std::vector<int> kept;
    for (const int index : chosen) {
        const auto at = std::lower_bound(later.references.begin(), later.references.end(), index);
        if (at != later.references.end() && *at == index)
            kept.push_back(static_cast<int>(at - later.references.begin()));
    }
    chosen = std::move(kept);
    return out;
}

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
            Frame frame = frames.read(index);
            if (!any_known(frame.depth.view)) {
                const auto files = frames.depth->files(index);
                throw DecodeError(
                    (files.empty() ? frames.references->where(index) : files[0].string()) +
                    ": all depth is unknown, expected some pixels above 0 m");
            }
            loaded.frames.push_back(std::move(frame));
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

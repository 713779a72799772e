#include "frames.hpp"

namespace xcalib::cli {
namespace {

StreamPointer picked(StreamPointer stream, const std::vector<int>& indices) {
    bool all = static_cast<int>(indices.size()) == stream->size();
    for (std::size_t i = 0; i < indices.size(); ++i) all = all && indices[i] == static_cast<int>(i);
    return all ? stream : std::make_shared<Picked>(std::move(stream), indices);
}

}  // namespace

Frame Frames::read(int index) const {
    Frame frame;
    frame.reference = (*references)[index];
    frame.source = (*sources)[index];
    frame.depth = (*depth)(index, frame.reference);
    return frame;
}

Frames open_frames(const FrameArguments& arguments, const std::optional<Rig>& rig,
                   Console& console) {
    if (arguments.depth.spec.empty()) throw InputError("Missing option '--depth'.");
    const StreamPointer references = open_stream(arguments.reference);
    const StreamPointer sources = open_stream(arguments.source);
    if (!arguments.reference_times.empty())
        references->times = read_times(arguments.reference_times, *references);
    if (!arguments.source_times.empty())
        sources->times = read_times(arguments.source_times, *sources);
    const FrameList names = references->frames();
    const Pairing pairing = pair_frames(names, sources->frames(), arguments.pairing,
                                        arguments.time_offset, arguments.max_gap);
    if (pairing.method == "time") console.note("frames: " + pairing.line());
    Frames frames;
    frames.depth = open_depth(arguments.depth, names, pairing.references);
    frames.is_plane = arguments.depth.spec == "plane";
    frames.references = picked(references, pairing.references);
    frames.sources = picked(sources, pairing.sources);
    if (rig && rig->relative_depth)
        console.note(
            "the rig was calibrated with relative depth: metres do not fit its translation");
    return frames;
}

Frames with_scalar_sources(Frames frames, const std::string& colormap, Console& console) {
    std::string said;
    frames.sources = scalar_sources(frames.sources, colormap, said);
    if (!said.empty()) console.note(said);
    return frames;
}

}  // namespace xcalib::cli

#include "open_frames.hpp"

#include <nlohmann/json.hpp>
#include <sstream>

#include "depth.hpp"
#include "flir_files.hpp"
#include "footage.hpp"
#include "motion.hpp"
#include "xcalib/rig_file.hpp"
#include "xcalib/stream/files.hpp"
#include "xcalib/stream/oriented.hpp"
#include "xcalib/stream/pairs.hpp"
#include "xcalib/stream/plan.hpp"

namespace xcalib::cli {

Rig load_rig(const std::string& file, Console& console) {
    const std::string suffix = lower_suffix(file);
    if (suffix == ".jpg" || suffix == ".jpeg") return radiometric_alignment(file);
    const Rig rig = xcalib::load_rig(file);
    for (const std::string& line : implausible(rig)) console.warn(file + ": " + line);
    return rig;
}

Frames open_frames(const FrameArguments& arguments, const std::optional<Rig>& rig,
                   Console& console) {
    if (arguments.depth.spec.empty()) {
        std::istringstream choices(depth_choices());
        for (std::string line; std::getline(choices, line);) console.note(line);
        throw InputError("--depth is missing, expected one of those above");
    }
    const bool turns = arguments.exif_orientation == "apply";
    auto [references, sources] = open_two(arguments.reference, arguments.source);
    for (StreamPointer* stream : {&references, &sources}) {
        if (const std::string line = orientation_line(**stream, turns); !line.empty())
            console.note(line);
        if (turns) *stream = oriented(*stream);
    }
    Pairs pairs(references, sources,
                {arguments.pairing, arguments.time_offset, arguments.max_gap,
                 arguments.reference_times, arguments.source_times});
    arguments.depth.plane.validate();
    const OpenDepth open = [&](const std::vector<int>& used) {
        return open_depth(arguments.depth, pairs.reference_list(), used);
    };
    if (rig) pairs.refine(*rig, open);
    const DepthPointer depth = open(pairs.pairing().references);
    for (const std::string& note : pairs.notes()) console.note(note);
    if (rig && rig->relative_depth)
        console.note(
            "the rig was calibrated with relative depth: metres do not fit its translation");
    return {pairs.references(),  pairs.sources(),         depth,
            pairs.all_sources(), pairs.pairing().sources, pairs.offset()};
}

Frames with_scalar_sources(Frames frames, const std::string& colormap, Console& console) {
    std::string said;
    frames.all_sources = scalar_sources(frames.all_sources, colormap, said);
    frames.sources = picked(frames.all_sources, frames.partners);
    if (!said.empty()) console.note(said);
    return frames;
}

std::vector<std::filesystem::path> given_files(const FrameArguments& arguments,
                                               const std::string& rig) {
    return {rig, arguments.reference_times, arguments.source_times,
            arguments.depth.stereo_calibration};
}

Readout readout_of(const FrameArguments& arguments, bool may_be_auto) {
    const std::optional<double> source =
                                    parse_readout("--source-readout", arguments.source_readout),
                                reference = parse_readout("--reference-readout",
                                                          arguments.reference_readout);
    if (!may_be_auto && !(source && reference))
        throw InputError(std::string(source ? "--reference-readout" : "--source-readout") +
                         " auto: expected the share that calibrate has found");
    if (!source && !reference)
        throw InputError(
            "--source-readout auto --reference-readout auto: only how they differ can be seen; "
            "expected a share for one of them");
    return {source.value_or(0), reference.value_or(0)};
}

Frames with_straight_rows(Frames frames, const Readout& readout, const std::optional<Rig>& rig,
                          bool nearest) {
    if (!readout.any()) return frames;
    frames.all_sources = straightened(frames.all_sources, readout, rig, motion_between, nearest);
    frames.sources = picked(frames.all_sources, frames.partners);
    return frames;
}

void say_depth(const Depth& depth, Console& console) {
    const std::string line = depth.line();
    if (line.empty()) return;
    console.line(line);
    console.event("note", {{"message", line}});
}

void say_plan(const Frames& frames, const std::vector<std::string>& outputs,
              const std::vector<int>& chosen, Console& console) {
    console.line(plan_text(frames, chosen));
    say_depth(*frames.depth, console);
    for (const std::string& output : outputs)
        if (!output.empty()) console.line("would be written: " + output);
}

}  // namespace xcalib::cli

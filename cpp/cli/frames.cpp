#include "frames.hpp"

#include <set>

#include "xcalib/footage/clock_offset.hpp"

namespace xcalib::cli {
namespace {

StreamPointer picked(StreamPointer stream, const std::vector<int>& indices) {
    bool all = static_cast<int>(indices.size()) == stream->size();
    for (std::size_t i = 0; i < indices.size(); ++i) all = all && indices[i] == static_cast<int>(i);
    return all ? stream : std::make_shared<Picked>(std::move(stream), indices);
}

EdgesOfFrame edges_of(const StreamPointer& stream) {
    return [stream](int index) -> std::optional<Image> {
        if (interrupted) throw Interrupted();
        try {
            const cv::Mat image = (*stream)[index];
            return motion_edges(view_of(image));
        } catch (const DecodeError&) {
            return std::nullopt;
        }
    };
}

// Two streams, how their frames belong together, and what was found on the way.
class Pairs {
   public:
    explicit Pairs(const FrameArguments& arguments)
        : arguments_(arguments), references_(open_stream(arguments.reference)),
          sources_(open_stream(arguments.source)) {
        if (!arguments.reference_times.empty())
            references_->times = read_times(arguments.reference_times, *references_);
        if (!arguments.source_times.empty())
            sources_->times = read_times(arguments.source_times, *sources_);
        reference_names_ = references_->frames();
        source_names_ = sources_->frames();
        double offset = arguments.time_offset.value_or(0.0);
        if (!arguments.time_offset) {
            if (arguments.pairing != "auto" && arguments.pairing != "time")
                throw InputError("a clock offset needs frames paired by time; they are by " +
                                 arguments.pairing);
            if (!references_->times || !sources_->times)
                throw InputError(
                    "a clock offset needs times of both streams' frames; expected them");
            estimate_ = estimate_offset(*references_->times, *sources_->times,
                                        edges_of(references_), edges_of(sources_));
            notes.push_back("clock offset: " + estimate_->line());
            offset = estimate_->offset;
        }
        pairing = pair_frames(reference_names_, source_names_, arguments.pairing, offset,
                              arguments.max_gap);
        if (pairing.method == "time") notes.push_back("frames: " + pairing.line());
    }

    // Pairs anew with the offset at which frames register best with the rig. Without an estimated
    // offset the pairs stay as they are, and so they do where the registered frames tell neither
    // around the estimate nor around 0.
    void refine(const Rig& rig) {
        if (!estimate_) return;
        RefinedOffset found = refined(estimate_->peak, rig);
        if (!found.told && estimate_->offset != 0) {
            // A peak elsewhere may be as high, and most clocks are meant to agree.
            RefinedOffset again = refined(0.0, rig);
            if (again.told) found = std::move(again);
        }
        const bool keep = estimate_->trusted || !found.told;
        notes.resize(keep ? 1 : 0);
        notes.push_back("clock offset: " + found.line());
        if (found.told)
            pairing = pair_frames(reference_names_, source_names_, "time", found.offset,
                                  arguments_.max_gap);
        notes.push_back("frames: " + pairing.line());
    }

    DepthPointer open_depth(const std::vector<int>& used) const {
        return cli::open_depth(arguments_.depth, reference_names_, used);
    }
    StreamPointer references() const { return picked(references_, pairing.references); }
    StreamPointer sources() const { return picked(sources_, pairing.sources); }

    Pairing pairing;
    std::vector<std::string> notes;

   private:
    RefinedOffset refined(double guess, const Rig& rig) const {
        const std::vector<double> candidates =
            offsets_around(guess, *references_->times, *sources_->times);
        std::vector<int> used = pairing.references;
        DepthPointer depth;
        if (references_->size() > sources_->size()) {
            // The neighbours of a paired reference tell too, if there is depth of them.
            try {
                std::set<int> every;
                for (const double offset : candidates)
                    for (const int index :
                         pair_frames(reference_names_, source_names_, "time", offset).references)
                        every.insert(index);
                const std::vector<int> wide(every.begin(), every.end());
                depth = open_depth(wide);
                used = wide;
            } catch (const InputError&) {
            }
        }
        if (!depth) depth = open_depth(used);
        const StreamPointer references = picked(references_, used);
        RegisteredNec judge(rig);
        int last = -1;
        cv::Mat reference, metres;
        const auto score = [&](int index, int other) -> std::optional<double> {
            if (interrupted) throw Interrupted();
            try {
                if (index != last) {
                    last = -1;
                    reference = (*references)[index];
                    metres = (*depth)(index, reference);
                    last = index;
                }
                const cv::Mat source = (*sources_)[other];
                return judge(view_of(reference), view_of(source), view_of(metres));
            } catch (const DecodeError&) {
                return std::nullopt;
            }
        };
        return refine_offset(*references->times, *sources_->times, candidates, score);
    }

    const FrameArguments& arguments_;
    StreamPointer references_, sources_;
    FrameList reference_names_, source_names_;
    std::optional<OffsetEstimate> estimate_;
};

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
    Pairs pairs(arguments);
    arguments.depth.plane.validate();
    if (rig) pairs.refine(*rig);
    Frames frames;
    frames.depth = pairs.open_depth(pairs.pairing.references);
    frames.references = pairs.references();
    frames.sources = pairs.sources();
    for (const std::string& note : pairs.notes) console.note(note);
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

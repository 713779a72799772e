#include "xcalib/stream/pairs.hpp"

#include <cmath>
#include <memory>
#include <set>

#include "xcalib/error.hpp"
#include "xcalib/stream/interrupts.hpp"

namespace xcalib {
namespace {

EdgesOfFrame edges_of(Stream& stream) {
    return [&stream](int index) -> std::optional<Image> {
        check_interrupts();
        try {
            return motion_edges(stream[index].view);
        } catch (const DecodeError&) {
            return std::nullopt;
        }
    };
}

void require_times(const Stream& references, const Stream& sources) {
    if (!references.times || !sources.times)
        throw InputError("a clock offset needs times of both streams' frames; expected them");
}

// One camera cannot be registered to itself.
void expect_two(const Stream& references, const Stream& sources) {
    if (references.size() == 0 || sources.size() == 0) return;
    if (references.where(0) == sources.where(0) && std::filesystem::exists(references.file(0)))
        throw InputError(references.where(0) +
                         ": REFERENCE and SOURCE are the same frames; expected those of two"
                         " cameras (#left and #right take the halves of wide frames, #top and"
                         " #bottom of high ones)");
}

// RegisteredNec of the frames of streams, which must outlive it.
PairScore scores_of(const Rig& rig, Stream& references, Stream& sources, Depth& depth) {
    struct State {
        explicit State(const Rig& rig) : judge(rig) {}
        RegisteredNec judge;
        int last = -1;  // candidates pair one reference with many sources
        Picture reference, metres;
    };
    return [&references, &sources, &depth, state = std::make_shared<State>(rig)](
               int index, int other) -> std::optional<double> {
        check_interrupts();
        State& s = *state;
        try {
            if (index != s.last) {
                s.last = -1;
                s.reference = references[index];
                s.metres = depth(index, s.reference);
                s.last = index;
            }
            return s.judge(s.reference.view, sources[other].view, s.metres.view);
        } catch (const DecodeError&) {
            return std::nullopt;
        }
    };
}

}  // namespace

OffsetEstimate estimate_offset(Stream& references, Stream& sources, double max_offset,
                               int max_frames) {
    require_times(references, sources);
    return estimate_offset(*references.times, *sources.times, edges_of(references),
                           edges_of(sources), max_offset, max_frames);
}

std::vector<double> offsets_around(double guess, const Stream& references, const Stream& sources) {
    require_times(references, sources);
    return offsets_around(guess, *references.times, *sources.times);
}

RefinedOffset refine_offset(const Rig& rig, Stream& references, Stream& sources, Depth& depth,
                            const std::vector<double>& candidates, int max_frames) {
    require_times(references, sources);
    return refine_offset(*references.times, *sources.times, candidates,
                         scores_of(rig, references, sources, depth), max_frames);
}

Pairs::Pairs(StreamPointer references, StreamPointer sources, const Matching& matching,
             std::optional<OffsetEstimate> estimate)
    : all_references_(std::move(references)), all_sources_(std::move(sources)), matching_(matching),
      estimate_(std::move(estimate)) {
    if (!matching.reference_times.empty())
        all_references_->times = read_times(matching.reference_times, *all_references_);
    if (!matching.source_times.empty())
        all_sources_->times = read_times(matching.source_times, *all_sources_);
    expect_two(*all_references_, *all_sources_);
    reference_list_ = all_references_->frames();
    source_list_ = all_sources_->frames();
    const bool by_time = matching.method == "time" ||
                         (matching.method == "auto" && reference_list_.times && source_list_.times);
    if (matching.offset.automatic && by_time) {
        if (!estimate_) estimate_ = estimate_offset(*all_references_, *all_sources_);
        notes_.push_back("clock offset: " + estimate_->line());
    } else if (matching.offset.automatic && !clock_of(source_list_)) {
        throw InputError(source_list_.where.at(0) +
                         ": a clock offset needs times of both streams' frames, or source frames"
                         " with consecutive numbers in their names; expected either");
    }
    const double offset = estimate_ ? estimate_->offset : matching.offset.seconds;
    pairing_ =
        pair_frames(reference_list_, source_list_, matching.method, offset, matching.max_gap);
    pairing_ = with_lag(pairing_, source_list_, matching.offset.frames);
    // Frames of files that nothing but their order pairs may be strangers.
    const bool by_order_alone = pairing_.method == "order" && matching.method == "auto" &&
                                !reference_list_.paths.empty() && !source_list_.paths.empty();
    if (pairing_.method == "time" || pairing_.lag != 0 || !pairing_.alone.empty() || by_order_alone)
        notes_.push_back("frames: " + pairing_.line() +
                         (by_order_alone ? ", for neither names nor numbers agree (--pair order"
                                           " says that this is meant)"
                                         : ""));
}

std::vector<std::string> Pairs::notes() const {
    std::vector<std::string> lines;
    for (const StreamPointer& stream : {all_references_, all_sources_})
        if (!stream->said.empty()) lines.push_back(stream->said);
    lines.insert(lines.end(), notes_.begin(), notes_.end());
    return lines;
}

void Pairs::refine(const Rig& rig, const OpenDepth& open_depth) {
    if (matching_.offset.automatic && !estimate_) return refine_frames(rig, open_depth);
    if (!estimate_) return;
    RefinedOffset found = refined(estimate_->peak, rig, open_depth);
    if (!found.decided && estimate_->offset != 0) {
        // A peak elsewhere may be as high, and most clocks are meant to agree.
        RefinedOffset again = refined(0.0, rig, open_depth);
        if (again.decided) found = std::move(again);
    }
    notes_.resize(estimate_->trusted || !found.decided ? 1 : 0);
    notes_.push_back("clock offset: " + found.line());
    if (found.decided)
        pairing_ =
            pair_frames(reference_list_, source_list_, "time", found.offset, matching_.max_gap);
    notes_.push_back("frames: " + pairing_.line());
}

void Pairs::refine_frames(const Rig& rig, const OpenDepth& open_depth) {
    constexpr int kEitherWay = 6;
    std::vector<double> candidates;
    for (int lag = -kEitherWay; lag <= kEitherWay; ++lag) candidates.push_back(lag);
    const FrameClock clock = clock_of(source_list_).value();
    std::vector<double> ticks;
    for (const int source : pairing_.sources)
        ticks.push_back(clock.ticks[static_cast<std::size_t>(source)]);
    const StreamPointer paired = references();
    const DepthPointer depth = open_depth(pairing_.references);
    const RefinedOffset found = refine_offset(ticks, clock.ticks, candidates,
                                              scores_of(rig, *paired, *all_sources_, *depth));
    const int lag = found.decided ? static_cast<int>(std::lround(found.offset)) : 0;
    pairing_ = with_lag(pairing_, source_list_, lag);
    notes_ = {!found.decided ? "clock offset: registered frames do not tell it, none is used"
              : lag == 0     ? "clock offset: frames register best as they are paired"
                         : "clock offset: frames register best with the source " + lateness(lag),
              "frames: " + pairing_.line()};
}

RefinedOffset Pairs::refined(double guess, const Rig& rig, const OpenDepth& open_depth) const {
    const std::vector<double> candidates = offsets_around(guess, *all_references_, *all_sources_);
    std::vector<int> used = pairing_.references;
    DepthPointer depth;
    if (all_references_->size() > all_sources_->size()) {
        // The neighbours of a paired reference tell too, if there is depth of them.
        try {
            std::set<int> every;
            for (const double offset : candidates)
                for (const int index :
                     pair_frames(reference_list_, source_list_, "time", offset).references)
                    every.insert(index);
            const std::vector<int> wide(every.begin(), every.end());
            depth = open_depth(wide);
            used = wide;
        } catch (const InputError&) {
        }
    }
    if (!depth) depth = open_depth(used);
    const StreamPointer references = picked(all_references_, used);
    return refine_offset(rig, *references, *all_sources_, *depth, candidates);
}

}  // namespace xcalib

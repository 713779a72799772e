#include "xcalib/stream/neighbours.hpp"

#include <algorithm>
#include <map>

#include "xcalib/error.hpp"
#include "xcalib/stream/interrupts.hpp"

namespace xcalib {
namespace {

// At most kMaxLagFrames, spread over those that have the most neighbours.
std::vector<std::size_t> frames_to_look_at(const std::map<int, std::vector<int>>& partners,
                                           std::size_t count) {
    std::map<int, std::vector<std::size_t>, std::greater<>> by_neighbours;
    for (std::size_t i = 0; i < count; ++i) {
        int neighbours = 0;
        for (const auto& [lag, at_lag] : partners) neighbours += at_lag[i] >= 0;
        by_neighbours[neighbours].push_back(i);
    }
    std::vector<std::size_t> out;
    for (const auto& [neighbours, frames] : by_neighbours) {
        const std::size_t wanted = std::min(frames.size(), std::size_t{kMaxLagFrames} - out.size());
        for (std::size_t i = 0; i < wanted; ++i) out.push_back(frames[i * frames.size() / wanted]);
    }
    std::sort(out.begin(), out.end());
    return out;
}

}  // namespace

LagReport fit_lags(const FittedFrames& frames, Stream& all_sources, const Rig& rig,
                   const CalibrationOptions& options, const std::function<void(double)>& progress) {
    const std::optional<FrameClock> clock = clock_of(all_sources.frames());
    if (!clock) return {};
    std::map<int, std::vector<int>> partners;
    for (int lag = -kMaxLag; lag <= kMaxLag; ++lag)
        if (lag != 0) partners[lag] = frames_later(*clock, frames.partners, lag);
    const std::vector<std::size_t> chosen = frames_to_look_at(partners, frames.partners.size());
    if (static_cast<int>(chosen.size()) < kMinLagFrames) return {};

    // In the order of the footage: a video is decoded once.
    std::map<int, std::vector<Picture>> pictures;
    std::vector<ImageView> references, depths;
    std::map<int, SourcesAtLag> lags;
    for (int lag = -kMaxLag; lag <= kMaxLag; ++lag) lags[lag].lag = lag;
    for (const std::size_t i : chosen) {
        references.push_back(frames.references[i]);
        depths.push_back(frames.depths[i]);
        lags[0].sources.push_back(frames.sources[i]);
        for (const auto& [lag, at_lag] : partners) {
            check_interrupts();
            Picture picture;
            try {
                if (at_lag[i] >= 0) picture = all_sources[at_lag[i]];
            } catch (const DecodeError&) {
                // As if the footage had no such frame.
            }
            lags[lag].sources.push_back(picture.view);
            pictures[lag].push_back(std::move(picture));
        }
        progress(static_cast<double>(references.size()) / static_cast<double>(chosen.size()));
    }
    std::vector<SourcesAtLag> rising;
    for (auto& [lag, at_lag] : lags) rising.push_back(std::move(at_lag));
    return fit_lags(references, depths, rising, rig, options);
}

void add_lags(const LagReport& lag, const TimeOffset& offset, const Stream& all_sources,
              CalibrationResult& result) {
    result.report.lag = lag;
    if (lag.frames == 0 && lag.change == 0) return;
    result.distrust(
        lag.line(),
        lag.change != 0
            ? "it lost frames, or a pause was not counted; give times of both (--source-times), or "
              "a part of the footage"
            : "try " + option_for_lag(offset, lag.frames, clock_of(all_sources.frames()).value()));
}

}  // namespace xcalib

#include "xcalib/footage/sequence.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>

#include "base/format.hpp"

namespace xcalib {
namespace {

constexpr double kMaxPeriod = 1.0;   // [s] of frames that follow each other
constexpr double kNear = 0.35;       // [periods] that a frame may be off its tick
constexpr std::size_t kDigits = 15;  // that a double holds

struct Name {
    std::vector<std::string> text;  // between the numbers
    std::vector<double> numbers;
};

bool is_digit(char c) { return c >= '0' && c <= '9'; }

std::optional<Name> split(const std::string& name) {
    Name out;
    out.text.emplace_back();
    for (std::size_t at = 0; at < name.size();) {
        if (!is_digit(name[at])) {
            out.text.back() += name[at++];
            continue;
        }
        std::size_t end = at;
        while (end < name.size() && is_digit(name[end])) ++end;
        if (end - at > kDigits) return std::nullopt;
        double number = 0;
        std::from_chars(name.data() + at, name.data() + end, number);
        out.numbers.push_back(number);
        out.text.emplace_back();
        at = end;
    }
    return out;
}

// The one number in which all names differ; empty where there is none, or more.
std::vector<double> numbers_of(const std::vector<std::string>& names) {
    std::vector<Name> parts;
    for (const std::string& name : names) {
        std::optional<Name> part = split(name);
        if (!part || (!parts.empty() && part->text != parts[0].text)) return {};
        parts.push_back(std::move(*part));
    }
    std::vector<double> found;
    for (std::size_t k = 0; !parts.empty() && k < parts[0].numbers.size(); ++k) {
        std::vector<double> column;
        for (const Name& part : parts) column.push_back(part.numbers[k]);
        if (column.front() == column.back()) continue;
        if (!found.empty()) return {};
        found = std::move(column);
    }
    for (std::size_t i = 1; i < found.size(); ++i)
        if (found[i] <= found[i - 1]) return {};
    return found;
}

}  // namespace

std::optional<FrameClock> clock_of(const FrameList& frames) {
    if (frames.names.size() < 2) return std::nullopt;
    if (frames.times) {
        const double period = median_period(*frames.times);
        if (!(period > 0) || period > kMaxPeriod) return std::nullopt;
        return FrameClock{*frames.times, period, true};
    }
    std::vector<double> numbers = numbers_of(frames.names);
    if (numbers.empty() || median_period(numbers) != 1.0) return std::nullopt;
    return FrameClock{std::move(numbers), 1.0, false};
}

std::vector<int> frames_later(const FrameClock& clock, const std::vector<int>& frames, int lag) {
    const std::vector<double>& ticks = clock.ticks;
    std::vector<int> out;
    for (const int frame : frames) {
        if (lag == 0) {
            out.push_back(frame);
            continue;
        }
        const double wanted = ticks[static_cast<std::size_t>(frame)] + lag * clock.period;
        auto best = std::lower_bound(ticks.begin(), ticks.end(), wanted);
        if (best != ticks.begin() &&
            (best == ticks.end() || wanted - *(best - 1) <= *best - wanted))
            --best;
        const bool near = std::abs(*best - wanted) <= kNear * clock.period;
        out.push_back(near ? static_cast<int>(best - ticks.begin()) : -1);
    }
    return out;
}

Pairing with_lag(const Pairing& pairing, const FrameList& sources, int lag) {
    if (lag == 0) return pairing;
    const std::optional<FrameClock> clock = clock_of(sources);
    if (!clock)
        throw InputError(sources.where.at(0) +
                         ": the source frames are no sequence, so that none is " +
                         std::to_string(lag) +
                         " frames later; expected times, or consecutive numbers in the names");
    const std::vector<int> later = frames_later(*clock, pairing.sources, lag);
    Pairing out = pairing;
    out.references.clear();
    out.sources.clear();
    for (std::size_t i = 0; i < later.size(); ++i) {
        if (later[i] < 0) continue;
        out.references.push_back(pairing.references[i]);
        out.sources.push_back(later[i]);
    }
    if (out.sources.empty())
        throw InputError(sources.where.at(0) + ": no source frame is " + std::to_string(lag) +
                         " frames after the partner of a reference; expected a smaller offset");
    out.dropped_references += static_cast<int>(later.size() - out.sources.size());
    out.dropped_sources += static_cast<int>(later.size() - out.sources.size());
    out.lag += lag;
    return out;
}

TimeOffset parse_time_offset(const std::string& text) {
    TimeOffset out;
    if (text == "auto") {
        out.automatic = true;
        return out;
    }
    const bool plus = text.size() > 1 && text[0] == '+' && text[1] != '-';
    const char* const begin = text.data() + plus;
    const char* const end = text.data() + text.size();
    if (!text.empty() && text.back() == 'f') {
        if (std::from_chars(begin, end - 1, out.frames).ptr == end - 1 && begin != end - 1)
            return out;
    } else if (std::from_chars(begin, end, out.seconds).ptr == end && begin != end &&
               std::isfinite(out.seconds)) {
        return out;
    }
    throw InputError("Invalid value for '--time-offset': '" + text +
                     "' is neither `auto` nor a number of seconds (0.1) or of source frames (2f)");
}

std::string option_for_lag(const TimeOffset& offset, int lag, const FrameClock& clock) {
    if (clock.in_seconds && offset.frames == 0 && offset.seconds != 0)
        return format("--time-offset %.4f, or auto", offset.seconds + lag * clock.period);
    return format("--time-offset %df, or auto", offset.frames + lag);
}

std::string lateness(int lag) {
    return format("%d %s %s", std::abs(lag), std::abs(lag) == 1 ? "frame" : "frames",
                  lag < 0 ? "early" : "late");
}

}  // namespace xcalib

#include "xcalib/footage/pairing.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <functional>
#include <map>
#include <numeric>
#include <regex>
#include <set>
#include <sstream>
#include <utility>

#include "base/format.hpp"
#include "base/median.hpp"

namespace xcalib {
namespace {

using std::filesystem::path;

constexpr std::size_t kMaxName = 255;  // of which an expression takes little of the stack

bool is_digit(char c) { return c >= '0' && c <= '9'; }

// A number of any length, so that texts of one length compare as numbers.
std::string without_zeros(const std::string& digits) {
    const std::size_t first = digits.find_first_not_of('0');
    return first == std::string::npos ? "0" : digits.substr(first);
}

// Text and digits in turn, beginning with text.
std::vector<std::string> parts_of(const std::string& name) {
    std::vector<std::string> parts{""};
    for (const char c : name) {
        const bool digits = parts.size() % 2 == 0;
        if (is_digit(c) != digits) parts.emplace_back();
        parts.back() += c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
    }
    for (std::size_t i = 1; i < parts.size(); i += 2) parts[i] = without_zeros(parts[i]);
    return parts;
}

bool in_order(const std::vector<std::string>& a, const std::vector<std::string>& b) {
    for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
        if (a[i] == b[i]) continue;
        return i % 2 && a[i].size() != b[i].size() ? a[i].size() < b[i].size() : a[i] < b[i];
    }
    return a.size() < b.size();
}

std::string folder_of(const path& file) {
    return file.has_parent_path() ? file.parent_path().string() : ".";
}

std::string stem(const path& file) { return file.stem().string(); }

// Empty where there are none.
std::string numbers(const path& file) {
    const std::vector<std::string> parts = parts_of(file.stem().string());
    std::string found;
    for (std::size_t i = 1; i < parts.size(); i += 2) found += parts[i] + " ";
    return found;
}

// The last number of a name that has a stamp before it; empty where there is none.
std::string index_behind_stamp(const path& file) {
    const std::vector<std::string> parts = parts_of(file.stem().string());
    constexpr std::size_t kStamp = 8;  // digits of a date at least
    if (parts.size() < 4) return "";
    const std::size_t last = parts.size() - (parts.size() % 2 ? 2 : 1);
    bool stamp = false;
    for (std::size_t i = 1; i < last; i += 2) stamp = stamp || parts[i].size() >= kStamp;
    return stamp && parts[last].size() <= 6 ? parts[last] : "";
}

using ByKey = std::map<std::string, int>;

// Files by their key; none where keys are missing or not unique, and so are of no use.
ByKey by_key(const std::vector<path>& files, std::string (*key)(const path&)) {
    ByKey found;
    for (std::size_t i = 0; i < files.size(); ++i) {
        const std::string own = key(files[i]);
        if (own.empty()) return {};
        const auto [twin, is_new] = found.emplace(own, static_cast<int>(i));
        if (is_new) continue;
        if (key != &stem) return {};
        throw InputError(folder_of(files[i]) + " has both " +
                         files[static_cast<std::size_t>(twin->second)].filename().string() +
                         " and " + files[i].filename().string() + "; expected one file per frame");
    }
    return found;
}

std::string few(const std::vector<path>& files) {
    constexpr std::size_t kShown = 3;
    std::string text;
    for (std::size_t i = 0; i < std::min(kShown, files.size()); ++i)
        text += (i ? ", " : "") + path(folder_of(files[i])).filename().string() + "/" +
                files[i].filename().string();
    return text +
           (files.size() > kShown ? " and " + std::to_string(files.size() - kShown) + " more" : "");
}

std::vector<int> up_to(std::size_t count) {
    std::vector<int> indices(count);
    std::iota(indices.begin(), indices.end(), 0);
    return indices;
}

// None where it is no number, or not finite.
std::optional<double> number_of(const std::string& text) {
    double value = 0;
    const char* const begin = text.data() + (text.size() > 1 && text[0] == '+');
    const char* const end = text.data() + text.size();
    if (std::from_chars(begin, end, value).ptr != end || begin == end || !std::isfinite(value))
        return std::nullopt;
    return value;
}

// Days since 1970 of a date of the Gregorian calendar.
long days_of(int year, int month, int day) {
    const int y = year - (month <= 2), era = y / 400, of_era = y - era * 400;
    const int of_year = (153 * (month + (month > 2 ? -3 : 9)) + 2) / 5 + day - 1;
    return era * 146097L + of_era * 365L + of_era / 4 - of_era / 100 + of_year - 719468;
}

// A date and a time of day with a fraction of a second, as 20240131_235959.123 or
// 2024-01-31T23-59-59-123456 have it. Without a fraction frames share their second.
std::optional<double> time_of_date(const std::string& name) {
    static const std::regex kDate(
        R"((?:^|[^0-9])(19\d\d|20\d\d)[-_.]?(\d\d)[-_.]?(\d\d)[-_T ]?(\d\d)[-_.:h]?(\d\d)[-_.:m]?(\d\d)[-_.,](\d{3,9})(?:$|[^0-9]))");
    std::smatch found;
    if (name.size() > kMaxName || !std::regex_search(name, found, kDate)) return std::nullopt;
    const auto part = [&](std::size_t i) { return std::stoi(found[i].str()); };
    const int month = part(2), day = part(3), hour = part(4), minute = part(5), second = part(6);
    if (month < 1 || month > 12 || day < 1 || day > 31 || hour > 23 || minute > 59 || second > 60)
        return std::nullopt;
    const double fraction = *number_of("0." + found[7].str());
    return 86400.0 * static_cast<double>(days_of(part(1), month, day)) + 3600 * hour + 60 * minute +
           second + fraction;
}

// Seconds and the digits behind them, as SEC_NSEC names have them.
struct SplitTime {
    std::string seconds, rest;
};

std::optional<SplitTime> split_time_of(const std::string& name) {
    static const std::regex kSplit(R"((?:^|[^0-9])(\d{9,10})[-_](\d{1,9})(?:$|[^0-9]))");
    std::smatch found;
    if (name.size() > kMaxName || !std::regex_search(name, found, kSplit)) return std::nullopt;
    return SplitTime{found[1].str(), found[2].str()};
}

// Of all names or none. The digits behind the seconds count nanoseconds, or, where all have as
// many and fewer than nine, micro- or milliseconds.
std::optional<std::vector<double>> split_times_of(const std::vector<std::string>& names) {
    std::vector<SplitTime> parts;
    for (const std::string& name : names) {
        const std::optional<SplitTime> part = split_time_of(name);
        if (!part) return std::nullopt;
        parts.push_back(*part);
    }
    const auto as_many = [&](std::size_t digits) {
        return std::all_of(parts.begin(), parts.end(),
                           [&](const SplitTime& part) { return part.rest.size() == digits; });
    };
    const double unit = as_many(6) ? 1e-6 : as_many(3) ? 1e-3 : 1e-9;
    std::vector<double> times;
    for (const SplitTime& part : parts)
        times.push_back(*number_of(part.seconds) + *number_of(part.rest) * unit);
    return times;
}

// The time that a name holds, if it holds one and only one.
std::optional<double> time_of(const std::string& name) {
    constexpr const char* kPlaces = "0123456789.";
    std::optional<double> found;
    for (std::size_t at = name.find_first_of(kPlaces); at != std::string::npos;
         at = name.find_first_of(kPlaces, at)) {
        const std::size_t end = std::min(name.find_first_not_of(kPlaces, at), name.size());
        std::string run = name.substr(at, end - at);
        at = end;
        const std::size_t dot = run.find('.');
        if (dot == std::string::npos) {
            if (run.size() != 19 && run.size() != 16 && run.size() != 13) continue;
            run.insert(10, ".");
        } else if ((dot != 9 && dot != 10) || run.find('.', dot + 1) != std::string::npos ||
                   dot + 1 == run.size()) {
            continue;
        }
        if (found) return std::nullopt;
        found = number_of(run);
    }
    return found;
}

std::string stripped(const std::string& text, const char* characters = " \t\r\n\f\v") {
    const std::size_t first = text.find_first_not_of(characters);
    if (first == std::string::npos) return "";
    return text.substr(first, text.find_last_not_of(characters) - first + 1);
}

// Nano-, micro- and milliseconds by the number of digits, else seconds.
std::optional<double> seconds_of(const std::string& text) {
    std::optional<double> value = number_of(text);
    if (!value || !std::all_of(text.begin(), text.end(), is_digit)) return value;
    const std::size_t digits = text.size();
    return *value * (digits == 19 ? 1e-9 : digits == 16 ? 1e-6 : digits == 13 ? 1e-3 : 1.0);
}

}  // namespace

std::vector<int> natural_order(const std::vector<std::string>& names) {
    std::vector<std::vector<std::string>> keys;
    for (const std::string& name : names) keys.push_back(parts_of(name));
    std::vector<int> order = up_to(names.size());
    std::sort(order.begin(), order.end(), [&](int a, int b) {
        const auto i = static_cast<std::size_t>(a), j = static_cast<std::size_t>(b);
        return keys[i] == keys[j] ? names[i] < names[j] : in_order(keys[i], keys[j]);
    });
    return order;
}

namespace {

// The partners of two lists of files by a key, and what has none.
struct Matches {
    std::vector<int> first, second;
    std::vector<path> lost;
};

Matches matches_of(const std::vector<path>& first, const std::vector<path>& second,
                   std::string (*key)(const path&)) {
    const ByKey ours = by_key(first, key), theirs = by_key(second, key);
    Matches found;
    if (ours.empty() || theirs.empty()) return found;
    for (std::size_t i = 0; i < first.size(); ++i) {
        const auto partner = theirs.find(key(first[i]));
        if (partner == theirs.end()) {
            found.lost.push_back(first[i]);
        } else {
            found.first.push_back(static_cast<int>(i));
            found.second.push_back(partner->second);
        }
    }
    for (const path& file : second)
        if (!ours.count(key(file))) found.lost.push_back(file);
    return found;
}

// By the first key that pairs all; else by the first that pairs any.
Matches matches_of(const std::vector<path>& first, const std::vector<path>& second) {
    Matches best;
    for (const auto key : {&stem, &numbers, &index_behind_stamp}) {
        Matches found = matches_of(first, second, key);
        if (found.first.empty()) continue;
        if (found.lost.empty()) return found;
        if (best.first.empty()) best = std::move(found);
    }
    return best;
}

const char* const kOtherWays =
    "; expected the same names or numbers in both, or --pair order, or --pair time with"
    " --reference-times and --source-times";

std::string counts_of(const std::vector<path>& first, const std::vector<path>& second) {
    return folder_of(first[0]) + " (" + std::to_string(first.size()) + " files) and " +
           folder_of(second[0]) + " (" + std::to_string(second.size()) + " files)";
}

}  // namespace

std::vector<int> pair_files(const std::vector<path>& first, const std::vector<path>& second) {
    const Matches found = matches_of(first, second);
    if (!found.first.empty()) {
        if (found.lost.empty()) return found.second;
        throw InputError(counts_of(first, second) + " do not pair: without a partner " +
                         few(found.lost) + "; expected the same names or numbers in both");
    }
    if (first.size() != second.size())
        throw InputError(folder_of(first[0]) + " has " + std::to_string(first.size()) + " files, " +
                         folder_of(second[0]) + " has " + std::to_string(second.size()) +
                         "; expected as many in both, with the same names");
    return up_to(first.size());
}

Pairing pair_names(const std::vector<path>& first, const std::vector<path>& second) {
    Pairing pairing;
    pairing.method = "name";
    Matches found = matches_of(first, second);
    if (found.first.empty()) {
        if (first.size() != second.size())
            throw InputError(counts_of(first, second) +
                             " do not pair: no name or number is common to them" + kOtherWays);
        pairing.method = "order";
        pairing.references = pairing.sources = up_to(first.size());
        return pairing;
    }
    // A few that are alone are frames that one camera lost; many, that the names mean something
    // else.
    constexpr double kLeastPaired = 0.9;
    const double most = static_cast<double>(std::max(first.size(), second.size()));
    if (static_cast<double>(found.first.size()) < kLeastPaired * most)
        throw InputError(counts_of(first, second) + " do not pair: without a partner " +
                         few(found.lost) + kOtherWays);
    pairing.references = std::move(found.first);
    pairing.sources = std::move(found.second);
    pairing.dropped_references = static_cast<int>(first.size() - pairing.references.size());
    pairing.dropped_sources = static_cast<int>(second.size() - pairing.sources.size());
    if (!found.lost.empty()) pairing.alone = few(found.lost);
    return pairing;
}

std::optional<std::vector<double>> times_of_names(const std::vector<std::string>& names) {
    const auto each = [&](const auto& time_in) -> std::optional<std::vector<double>> {
        std::vector<double> times;
        for (const std::string& name : names) {
            const std::optional<double> time = time_in(name);
            if (!time) return std::nullopt;
            times.push_back(*time);
        }
        return times;
    };
    std::optional<std::vector<double>> times = each(time_of);
    if (!times) times = split_times_of(names);
    if (!times) times = each(time_of_date);
    const auto falls = [](double earlier, double later) { return later <= earlier; };
    if (!times || times->empty() ||
        std::adjacent_find(times->begin(), times->end(), falls) != times->end())
        return std::nullopt;
    return times;
}

std::vector<double> times_in_order(const std::string& text) {
    static const std::regex kDay(R"((\d{4})-(\d\d)-(\d\d)[ T](\d\d):(\d\d):(\d\d)(\.\d{1,9})?Z?)");
    std::vector<double> times;
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
        line = stripped(line);
        if (line.empty() || line[0] == '#') continue;
        std::smatch day;
        if (line.size() <= kMaxName && std::regex_match(line, day, kDay)) {
            const auto part = [&](std::size_t i) { return std::stoi(day[i].str()); };
            times.push_back(86400.0 * static_cast<double>(days_of(part(1), part(2), part(3))) +
                            3600.0 * part(4) + 60 * part(5) + part(6) +
                            (day[7].matched ? *number_of("0" + day[7].str()) : 0));
        } else if (const std::optional<double> time = seconds_of(line)) {
            times.push_back(*time);
        } else if (!times.empty()) {
            return {};
        }
    }
    return times;
}

constexpr std::size_t kMaxLine = 4096;

std::vector<double> times_of_table(const std::string& text, const std::string& table,
                                   const std::vector<std::string>& names) {
    static const std::regex separator(R"(\s*[,;]\s*|\s+)");
    std::map<std::string, double> found;
    std::set<std::string> given;
    std::istringstream lines(text);
    int number = 0;
    for (std::string line; std::getline(lines, line);) {
        ++number;
        line = stripped(line);
        if (line.empty() || line[0] == '#') continue;
        // Of which an expression would take the stack.
        if (line.size() > kMaxLine)
            throw InputError(table + " line " + std::to_string(number) + ": " +
                             std::to_string(line.size()) +
                             " characters, expected `name timestamp`");
        std::vector<std::string> cells(
            std::sregex_token_iterator(line.begin(), line.end(), separator, -1), {});
        for (std::string& cell : cells) cell = stripped(cell, " \"'");
        const std::optional<double> time =
            cells.size() > 1 ? seconds_of(cells[1]) : std::optional<double>();
        if (!time) {
            if (found.empty()) continue;  // a header
            throw InputError(table + " line " + std::to_string(number) + ": '" + line +
                             "', expected `name timestamp`");
        }
        if (!given.insert(cells[0]).second)
            throw InputError(table + " line " + std::to_string(number) + ": '" + cells[0] +
                             "' again, expected a line for each frame");
        found[cells[0]] = found[path(cells[0]).stem().string()] = *time;
    }
    std::vector<double> times;
    std::vector<std::string> lost;
    for (const std::string& name : names) {
        const auto at = found.find(name);
        if (at == found.end()) lost.push_back(name);
        else times.push_back(at->second);
    }
    if (!lost.empty())
        throw InputError(
            table + ": no time of " + lost[0] +
            (lost.size() > 1 ? " and " + std::to_string(lost.size() - 1) + " more" : "") +
            ", expected a line `name timestamp` for each frame");
    for (std::size_t i = 1; i < times.size(); ++i)
        if (times[i] < times[i - 1])
            throw InputError(table + ": " + names[i] + " is earlier than " + names[i - 1] +
                             ", expected rising times in the order of the frames");
    return times;
}

double median_period(const std::vector<double>& times) {
    std::vector<double> steps;
    for (std::size_t i = 1; i < times.size(); ++i) steps.push_back(times[i] - times[i - 1]);
    return steps.empty() ? 0.0 : median(std::move(steps));
}

std::string Pairing::line() const {
    std::string text = std::to_string(references.size()) + " pairs by " + method;
    if (method == "time")
        text += format(
            " (median gap %.1f ms, source late by %+.4f s); without a partner: %d reference,"
            " %d source frames",
            1e3 * gap, offset, dropped_references, dropped_sources);
    if (!alone.empty()) text += "; without a partner, and left out: " + alone;
    if (lag != 0) text += format("; source late by %+d of its frames", lag);
    return text;
}

Pairing pair_times(const std::vector<double>& references, const std::vector<double>& sources,
                   double offset, std::optional<double> max_gap) {
    if (!max_gap) {
        max_gap = std::max(median_period(references), median_period(sources)) / 2;
        if (*max_gap == 0) max_gap = 0.5;
    }
    if (!(*max_gap > 0))
        throw InputError(format("largest gap is %g s, expected above 0", *max_gap));
    std::vector<double> shifted = sources;
    for (double& time : shifted) time -= offset;
    const bool swapped = references.size() > shifted.size();
    const std::vector<double>& few = swapped ? shifted : references;
    const std::vector<double>& many = swapped ? references : shifted;
    // Half a period apart, rounding must not decide.
    const double limit = *max_gap * (1 + 1e-6);
    Pairing found;
    found.method = "time";
    found.offset = offset;
    std::vector<double> gaps;
    auto first = many.begin();
    for (std::size_t i = 0; i < few.size(); ++i) {
        if (i > 0 && few[i] == few[i - 1]) continue;  // two frames of one moment: one is wrong
        const auto distance = [&](auto at) { return std::abs(*at - few[i]); };
        auto best = std::lower_bound(first, many.end(), few[i]);
        if (best != first && (best == many.end() || distance(best - 1) <= distance(best))) --best;
        if (best == many.end() || distance(best) > limit) continue;
        const int own = static_cast<int>(i), other = static_cast<int>(best - many.begin());
        found.references.push_back(swapped ? other : own);
        found.sources.push_back(swapped ? own : other);
        gaps.push_back(distance(best));
        first = best + 1;
    }
    if (gaps.empty())
        throw InputError(format(
            "no two frames are within %g s: reference times are %.3f to %.3f s, source times"
            " %.3f to %.3f s; expected one clock, --time-offset, or --pair order",
            *max_gap, references.front(), references.back(), shifted.front(), shifted.back()));
    found.dropped_references = static_cast<int>(references.size() - gaps.size());
    found.dropped_sources = static_cast<int>(shifted.size() - gaps.size());
    found.gap = median(std::move(gaps));
    return found;
}

Pairing pair_frames(const FrameList& references, const FrameList& sources, const std::string& given,
                    double offset, std::optional<double> max_gap) {
    std::string method = given;
    const bool files = !references.paths.empty() && !sources.paths.empty();
    if (method == "auto")
        method = references.times && sources.times ? "time" : files ? "name" : "order";
    // What `auto` stands for is decided by now.
    if (std::find(kPairingMethods.begin() + 1, kPairingMethods.end(), method) ==
        kPairingMethods.end()) {
        std::string known;
        for (const char* one : kPairingMethods)
            known += (known.empty() ? "" : ", ") + std::string(one);
        throw InputError("pairing is '" + method + "', expected one of " + known);
    }
    if (offset != 0 && method != "time")
        throw InputError(
            format("a clock offset of %g s needs frames paired by time; they are by %s; expected"
                   " times, as by --reference-times and --source-times, or --time-offset in frames"
                   " (2f)",
                   offset, method.c_str()));
    if (method == "time") {
        for (const auto& [what, list] : {std::pair{"reference", &references}, {"source", &sources}})
            if (!list->times)
                throw InputError(list->where.at(0) + ": the " + what +
                                 " frames have no times that rise; expected them in the file"
                                 " names, in timestamps.csv, in a video or bag, or by --" +
                                 what + "-times FILE");
        return pair_times(*references.times, *sources.times, offset, max_gap);
    }
    Pairing found;
    found.method = method;
    found.references = up_to(references.names.size());
    if (method == "name") {
        if (!files)
            throw InputError(
                "pairing by name needs two folders of images; expected --pair order or --pair "
                "time");
        found = pair_names(references.paths, sources.paths);
        if (given == "name" && found.method != "name")
            throw InputError(counts_of(references.paths, sources.paths) +
                             " do not pair by name: no name or number is common to them;"
                             " expected --pair order");
        return found;
    }
    if (references.names.size() != sources.names.size())
        throw InputError(references.where.at(0) + " is the first of " +
                         std::to_string(references.names.size()) + " frames, " +
                         sources.where.at(0) + " of " + std::to_string(sources.names.size()) +
                         "; expected as many, or times to pair them by: --reference-times and"
                         " --source-times");
    found.sources = found.references;
    return found;
}

std::vector<int> nearest_depths(const FrameList& references, const std::vector<int>& used,
                                const std::vector<double>& depths, const std::string& where) {
    const double period = median_period(references.times.value());
    std::vector<double> times;
    for (const int index : used)
        times.push_back((*references.times)[static_cast<std::size_t>(index)]);
    const Pairing found =
        pair_times(times, depths, 0.0, period > 0 ? std::optional(period / 2) : std::nullopt);
    const std::set<int> paired(found.references.begin(), found.references.end());
    for (std::size_t i = 0; i < used.size(); ++i)
        if (!paired.count(static_cast<int>(i)))
            throw InputError(where + ": no depth map near the time of " +
                             references.where[static_cast<std::size_t>(used[i])] +
                             format(", %.6f s", times[i]));
    return found.sources;
}

std::vector<int> match_depths(const FrameList& references, const std::vector<int>& used,
                              const FrameList& depths) {
    std::map<std::string, int> own;
    for (std::size_t i = 0; i < depths.names.size(); ++i)
        own[depths.names[i]] = static_cast<int>(i);
    const auto name = [&](int index) { return references.names[static_cast<std::size_t>(index)]; };
    std::vector<int> matched;
    for (const int index : used)
        if (const auto found = own.find(name(index)); found != own.end())
            matched.push_back(found->second);
    if (own.size() == depths.names.size() && matched.size() == used.size()) return matched;
    if (references.times && depths.times)
        return nearest_depths(references, used, *depths.times, folder_of(depths.paths.at(0)));
    const bool all = depths.names.size() == references.names.size();
    std::vector<path> partners;
    const std::size_t frame = references.where.at(0).rfind(" frame ");
    const std::string footage =
        frame == std::string::npos ? "" : references.where[0].substr(0, frame);
    for (const int index : all ? up_to(references.names.size()) : used)
        partners.push_back(references.paths.empty()
                               ? path(footage + "/" + name(index) + ".png")
                               : references.paths[static_cast<std::size_t>(index)]);
    matched = pair_files(partners, depths.paths);
    if (!all) return matched;
    std::vector<int> of_used;
    for (const int index : used) of_used.push_back(matched[static_cast<std::size_t>(index)]);
    return of_used;
}

}  // namespace xcalib

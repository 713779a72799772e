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

std::vector<int> pair_files(const std::vector<path>& first, const std::vector<path>& second) {
    const auto count = [](const std::vector<path>& files) { return std::to_string(files.size()); };
    for (const auto key : {&stem, &numbers}) {
        const ByKey ours = by_key(first, key), theirs = by_key(second, key);
        std::vector<int> partners;
        std::vector<path> lost;
        for (const path& file : first) {
            const auto found = theirs.find(key(file));
            if (found != theirs.end()) partners.push_back(found->second);
            else lost.push_back(file);
        }
        if (ours.empty() || partners.empty()) continue;
        for (const path& file : second)
            if (!ours.count(key(file))) lost.push_back(file);
        if (lost.empty()) return partners;
        throw InputError(folder_of(first[0]) + " (" + count(first) + " files) and " +
                         folder_of(second[0]) + " (" + count(second) +
                         " files) do not pair: without a partner " + few(lost) +
                         "; expected the same names or numbers in both");
    }
    if (first.size() != second.size())
        throw InputError(folder_of(first[0]) + " has " + count(first) + " files, " +
                         folder_of(second[0]) + " has " + count(second) +
                         "; expected as many in both, with the same names");
    return up_to(first.size());
}

std::optional<std::vector<double>> times_of_names(const std::vector<std::string>& names) {
    std::vector<double> times;
    for (const std::string& name : names) {
        const std::optional<double> time = time_of(name);
        if (!time || (!times.empty() && *time <= times.back())) return std::nullopt;
        times.push_back(*time);
    }
    if (times.empty()) return std::nullopt;
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
            " %.3f to %.3f s; expected one clock, or --pair order",
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
            format("a clock offset of %g s needs frames paired by time; they are by %s", offset,
                   method.c_str()));
    if (method == "time") {
        for (const auto& [what, list] : {std::pair{"reference", &references}, {"source", &sources}})
            if (!list->times)
                throw InputError(list->where.at(0) + ": the " + what +
                                 " frames have no times that rise; expected them in the file"
                                 " names, in timestamps.csv, or in a video or bag");
        return pair_times(*references.times, *sources.times, offset, max_gap);
    }
    Pairing found;
    found.method = method;
    found.references = up_to(references.names.size());
    if (method == "name") {
        if (!files)
            throw InputError("pairing by name needs two folders of images; expected order or time");
        found.sources = pair_files(references.paths, sources.paths);
        return found;
    }
    if (references.names.size() != sources.names.size())
        throw InputError(references.where.at(0) + " is the first of " +
                         std::to_string(references.names.size()) + " frames, " +
                         sources.where.at(0) + " of " + std::to_string(sources.names.size()) +
                         "; expected as many, or times to pair them by");
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

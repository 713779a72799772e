#include "xcalib/footage/clock_offset.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "base/format.hpp"
#include "base/median.hpp"
#include "photometry/mat.hpp"
#include "xcalib/footage/pairing.hpp"
#include "xcalib/gray.hpp"
#include "xcalib/nec.hpp"
#include "xcalib/register.hpp"

namespace xcalib {
namespace {

constexpr int kRows = 4, kColumns = 6;  // cells
constexpr int kCells = kRows * kColumns;
constexpr int kWidth = 160;              // at which edges are taken [px]
constexpr double kMinCorrelation = 0.2;  // of a peak that counts
constexpr double kMinContrast = 0.12;    // what it stands above every other [correlation]
constexpr std::size_t kMinCount = 16;    // frames, and samples in common, that are enough
constexpr int kEitherWay = 24;           // quarters of a frame

double mean(const std::vector<double>& values) {
    double sum = 0;
    for (const double value : values) sum += value;
    return sum / static_cast<double>(values.size());
}

// Gray in [0, 1] at most kWidth wide.
cv::Mat small_gray(const ImageView& image) {
    Image finite;
    ImageView view = image;
    if (image.type == PixelType::f32) {
        finite = Image(image.width * image.channels, image.height);
        for (int y = 0; y < image.height; ++y)
            for (int x = 0; x < finite.width; ++x) {
                const float value = image.row<float>(y)[x];
                finite.row(y)[x] = std::isfinite(value) ? value : 0.0f;
            }
        view.data = finite.pixels.data();
        view.row_bytes = static_cast<std::ptrdiff_t>(sizeof(float)) * finite.width;
    }
    const int height =
        static_cast<int>(std::nearbyint(static_cast<double>(kWidth) * image.height / image.width));
    const Image gray = to_gray(view);
    cv::Mat small;
    cv::resize(as_mat(gray), small, {kWidth, std::max(kRows, height)}, 0, 0, cv::INTER_AREA);
    return small;
}

// The change of edges in each cell, and its mean over the cells, at times between frames [s].
struct Motion {
    std::vector<double> times;
    std::vector<std::vector<double>> columns = std::vector<std::vector<double>>(kCells + 1);
};

Motion edge_motion(const std::vector<double>& times, std::size_t begin, std::size_t end,
                   const EdgesOfFrame& edges_of) {
    Motion motion;
    Image before;
    double last = 0;
    for (std::size_t i = begin; i < end; ++i) {
        std::optional<Image> edges = edges_of(static_cast<int>(i));
        if (!edges) continue;  // named when its turn comes; the next ones will do
        if (!before.pixels.empty()) {
            cv::Mat change, cells;
            cv::absdiff(as_mat(*edges), as_mat(before), change);
            cv::resize(change, cells, {kColumns, kRows}, 0, 0, cv::INTER_AREA);
            motion.times.push_back((times[i] + last) / 2);
            double sum = 0;
            for (int c = 0; c < kCells; ++c) {
                const double value = cells.at<float>(c / kColumns, c % kColumns);
                motion.columns[static_cast<std::size_t>(c)].push_back(value);
                sum += value;
            }
            motion.columns[kCells].push_back(sum / kCells);
        }
        before = std::move(*edges);
        last = times[i];
    }
    return motion;
}

// A jump of the gain, or a frame shown twice, is one frame's matter: of three neighbours take the
// median, and of the rest what lies within three deviations.
void clean(std::vector<double>& values) {
    const std::vector<double> given = values;
    const std::size_t last = given.size() - 1;
    for (std::size_t i = 0; i <= last; ++i) {
        const double a = given[i ? i - 1 : 0], b = given[i], c = given[std::min(i + 1, last)];
        values[i] = std::max(std::min(a, b), std::min(std::max(a, b), c));
    }
    const double middle = median(values);
    std::vector<double> off;
    for (const double value : values) off.push_back(std::abs(value - middle));
    const double spread = 1.4826 * median(off) + 1e-9;
    for (double& value : values)
        value = std::clamp(value, middle - 3 * spread, middle + 3 * spread);
}

double interpolated(const std::vector<double>& times, const std::vector<double>& values,
                    double time) {
    const auto after = std::upper_bound(times.begin(), times.end(), time);
    if (after == times.begin()) return values.front();
    if (after == times.end()) return values.back();
    const auto i = static_cast<std::size_t>(after - times.begin());
    const double share = (time - times[i - 1]) / (times[i] - times[i - 1]);
    return values[i - 1] + share * (values[i] - values[i - 1]);
}

// A motion on the points k * step [s] of time, from `first` on, cleaned.
struct Samples {
    double first = 0.0;
    std::vector<std::vector<double>> columns;
};

// Footage with pauses has fewer frames than samples; where it is all pause, its times are wrong.
constexpr double kMaxSamples = 32;  // a frame

Samples resampled(Motion motion, double step) {
    const double first = std::ceil(motion.times.front() / step);
    const double last = std::floor(motion.times.back() / step);
    if (last - first > kMaxSamples * static_cast<double>(motion.times.size()))
        throw InputError(format(
            "times from %.3f to %.3f s have %zu frames, expected one at least"
            " every %g s in the mean",
            motion.times.front(), motion.times.back(), motion.times.size(), kMaxSamples * step));
    Samples out{first * step, {}};
    for (std::vector<double>& column : motion.columns) {
        clean(column);
        std::vector<double> samples;
        for (double k = first; k <= last; ++k)
            samples.push_back(interpolated(motion.times, column, k * step));
        out.columns.push_back(std::move(samples));
    }
    return out;
}

// Half of the whole, half of the cells: correlation of a[k] with b[k + shift].
double correlation(const Samples& a, const Samples& b, long shift) {
    const long length = static_cast<long>(a.columns[0].size());
    const long other = static_cast<long>(b.columns[0].size());
    const long begin = std::max(0L, -shift), end = std::min(length, other - shift);
    if (end - begin < static_cast<long>(kMinCount)) return -1.0;
    double cells = 0, whole = 0;
    for (std::size_t c = 0; c < a.columns.size(); ++c) {
        const double *x = a.columns[c].data(), *y = b.columns[c].data() + shift;
        double mean_x = 0, mean_y = 0, xx = 0, yy = 0, xy = 0;
        for (long k = begin; k < end; ++k) {
            mean_x += x[k];
            mean_y += y[k];
        }
        mean_x /= static_cast<double>(end - begin);
        mean_y /= static_cast<double>(end - begin);
        for (long k = begin; k < end; ++k) {
            const double dx = x[k] - mean_x, dy = y[k] - mean_y;
            xx += dx * dx;
            yy += dy * dy;
            xy += dx * dy;
        }
        const double each = xy / std::max(std::sqrt(xx * yy), 1e-12);
        if (c < kCells) cells += each / kCells;
        else whole = each;
    }
    return (cells + whole) / 2;
}

// The offset at which two sampled signals correlate best.
OffsetEstimate best_offset(const Samples& a, const Samples& b, double step, double limit) {
    const long apart = std::lround((b.first - a.first) / step);
    const long most = static_cast<long>(limit / step);
    std::vector<double> scores;
    for (long lag = -most; lag <= most; ++lag) scores.push_back(correlation(a, b, lag - apart));
    const auto best =
        static_cast<std::size_t>(std::max_element(scores.begin(), scores.end()) - scores.begin());
    // The lobe of the peak ends where the curve turns up again on either side.
    std::size_t left = best, right = best;
    while (left > 0 && scores[left - 1] < scores[left]) --left;
    while (right + 1 < scores.size() && scores[right + 1] < scores[right]) ++right;
    double elsewhere = -1.0;
    for (std::size_t i = 0; i < scores.size(); ++i)
        if (i < left || i > right) elsewhere = std::max(elsewhere, scores[i]);
    OffsetEstimate out;
    out.correlation = scores[best];
    const bool any_elsewhere = left > 0 || right + 1 < scores.size();
    out.contrast = any_elsewhere ? scores[best] - elsewhere : 0.0;
    const bool inner = best > 0 && best + 1 < scores.size();
    double shift = 0.0;
    if (inner) {
        const double below = scores[best - 1], above = scores[best + 1];
        const double bend = below - 2 * scores[best] + above;
        if (bend < 0) shift = 0.5 * (below - above) / bend;
    }
    out.peak = (static_cast<double>(best) - static_cast<double>(most) + shift) * step;
    out.trusted = inner && out.correlation >= kMinCorrelation && out.contrast >= kMinContrast;
    if (out.trusted) out.offset = out.peak;
    return out;
}

// The verdict on the NEC of each frame, `rows`, at each of the candidates.
RefinedOffset verdict(const std::vector<double>& candidates,
                      const std::vector<std::vector<double>>& rows) {
    const std::size_t count = candidates.size(), middle = count / 2;
    if (rows.size() < 2) return {candidates[middle], false, {}};
    std::vector<double> means(count);
    for (std::size_t c = 0; c < count; ++c) {
        std::vector<double> column;
        for (const std::vector<double>& row : rows) column.push_back(row[c]);
        means[c] = mean(column);
    }
    const auto best =
        static_cast<std::size_t>(std::max_element(means.begin(), means.end()) - means.begin());
    const auto frames = static_cast<double>(rows.size());
    std::vector<bool> worse;
    for (std::size_t c = 0; c < count; ++c) {
        std::vector<double> lost;
        for (const std::vector<double>& row : rows) lost.push_back(row[best] - row[c]);
        const double average = mean(lost);
        double squares = 0;
        for (const double value : lost) squares += (value - average) * (value - average);
        const double error = std::sqrt(squares / (frames - 1)) / std::sqrt(frames);
        worse.push_back(average > std::max(2 * error, 1e-12));
    }
    const bool decided = worse.front() && worse.back();
    std::size_t near = best;
    const auto distance = [middle](std::size_t c) { return c > middle ? c - middle : middle - c; };
    for (std::size_t c = count; c-- > 0;)
        if (!worse[c] && distance(c) <= distance(near)) near = c;
    return {candidates[decided ? near : middle], decided, means};
}

}  // namespace

std::string OffsetEstimate::line() const {
    const std::string figures =
        format("correlation %.2f, %.2f above the next peak", correlation, contrast);
    if (trusted) return format("source late by %+.4f s (%s)", offset, figures.c_str());
    return "the footage moves too little to tell a clock offset, 0 s is used (" + figures + ")";
}

Image motion_edges(const ImageView& image) {
    const cv::Mat plain = blurred(small_gray(image), 1.0);
    cv::Mat across, down;
    cv::Sobel(plain, across, CV_32F, 1, 0);
    cv::Sobel(plain, down, CV_32F, 0, 1);
    Image edges(plain.cols, plain.rows);
    cv::Mat magnitude = as_mat(edges);
    cv::magnitude(across, down, magnitude);
    // Gain control scales all of them; a few hot edges must not set the scale.
    const auto scale = static_cast<float>(std::max(quantile(edges.pixels, 0.9), 1e-6));
    for (float& value : edges.pixels) value = std::min(value / scale, 2.0f);
    return edges;
}

OffsetEstimate estimate_offset(const std::vector<double>& references,
                               const std::vector<double>& sources,
                               const EdgesOfFrame& reference_edges,
                               const EdgesOfFrame& source_edges, double max_offset,
                               int max_frames) {
    const std::size_t wanted =
        std::min(references.size(), static_cast<std::size_t>(std::max(max_frames, 0)));
    const std::size_t first = (references.size() - wanted) / 2, end = first + wanted;
    if (wanted == 0 || sources.empty()) return {};
    const double begin_time = references[first], end_time = references[end - 1];
    const auto begin_source =
        std::lower_bound(sources.begin(), sources.end(), begin_time - max_offset);
    const auto end_source = std::upper_bound(begin_source, sources.end(), end_time + max_offset);
    if (begin_source == end_source)
        throw InputError(
            format("source times %.3f to %.3f s are more than %g s from reference"
                   " times %.3f to %.3f s",
                   sources.front(), sources.back(), max_offset, begin_time, end_time));
    const auto near = static_cast<std::size_t>(end_source - begin_source);
    if (wanted < kMinCount || near < kMinCount) return {};
    const auto place = [](auto i) { return static_cast<std::ptrdiff_t>(i); };
    const double step =
        std::max(
            median_period({references.begin() + place(first), references.begin() + place(end)}),
            median_period({begin_source, end_source})) /
        2;
    if (!(step > 0)) return {};
    const auto other = static_cast<std::size_t>(begin_source - sources.begin());
    Motion one = edge_motion(references, first, end, reference_edges);
    Motion two = edge_motion(sources, other, other + near, source_edges);
    if (std::min(one.times.size(), two.times.size()) + 1 < kMinCount) return {};
    return best_offset(resampled(std::move(one), step), resampled(std::move(two), step), step,
                       std::min(max_offset, (end_time - begin_time) / 3));
}

std::string RefinedOffset::line() const {
    if (scores.empty()) return "too few frames overlap to confirm or refine it by registration";
    const std::string figures =
        format("NEC up to %.3f, at the ends of the offsets tried %.3f and %.3f",
               *std::max_element(scores.begin(), scores.end()), scores.front(), scores.back());
    if (decided)
        return format("frames register best with the source late by %+.4f s (%s)", offset,
                      figures.c_str());
    return "registered frames change too little to confirm or refine it (" + figures + ")";
}

std::vector<double> offsets_around(double guess, const std::vector<double>& references,
                                   const std::vector<double>& sources) {
    const double period = std::min(median_period(references), median_period(sources));
    std::vector<double> candidates;
    for (int quarters = -kEitherWay; quarters <= kEitherWay; ++quarters)
        candidates.push_back(guess + period * quarters / 4);
    return candidates;
}

struct RegisteredNec::State {
    Rig rig;
    std::optional<Registrar> registrar{};
};

RegisteredNec::RegisteredNec(const Rig& rig) : state_(new State{rig}) {}

RegisteredNec::~RegisteredNec() = default;

double RegisteredNec::operator()(const ImageView& reference, const ImageView& source,
                                 const ImageView& depth) {
    State& s = *state_;
    if (!s.registrar)
        s.registrar.emplace(
            fitted(s.rig, reference.width, reference.height, source.width, source.height));
    const Pinhole& grid = s.registrar->rig().reference;
    const int row = grid.width * source.channels;
    std::vector<char> pixels(bytes_per_channel(source.type) * static_cast<std::size_t>(row) *
                             static_cast<std::size_t>(grid.height));
    std::vector<std::uint8_t> mask(static_cast<std::size_t>(grid.width) *
                                   static_cast<std::size_t>(grid.height));
    const auto row_bytes = static_cast<std::ptrdiff_t>(bytes_per_channel(source.type)) * row;
    s.registrar->register_frame(
        source, depth,
        {pixels.data(), grid.width, grid.height, source.channels, source.type, row_bytes},
        mask.data());
    for (std::uint8_t& code : mask) code = code == 0;
    const double value = nec(
        to_gray(reference),
        to_gray({pixels.data(), grid.width, grid.height, source.channels, source.type, row_bytes}),
        mask.data());
    return std::isfinite(value) ? value : 0.0;
}

RefinedOffset refine_offset(const std::vector<double>& references,
                            const std::vector<double>& sources,
                            const std::vector<double>& candidates, const PairScore& score,
                            int max_frames) {
    if (candidates.empty()) throw InputError("no candidate offsets, expected some");
    // A frame of the slower stream, and the pair it is in at each candidate.
    const bool by_source = references.size() > sources.size();
    std::vector<std::map<int, std::pair<int, int>>> pairs;
    // Wider than pairing itself: jitter must not take a frame's partner away between two others.
    const double wide = 0.75 * std::max(median_period(references), median_period(sources));
    for (const double offset : candidates) {
        Pairing found;
        try {
            found = pair_times(references, sources, offset,
                               wide > 0 ? std::optional(wide) : std::nullopt);
        } catch (const InputError&) {
            return {candidates[candidates.size() / 2], false, {}};
        }
        std::map<int, std::pair<int, int>>& at = pairs.emplace_back();
        for (std::size_t i = 0; i < found.references.size(); ++i) {
            const std::pair pair(found.references[i], found.sources[i]);
            at[by_source ? pair.second : pair.first] = pair;
        }
    }
    std::vector<int> common;
    for (const auto& [frame, pair] : pairs[0])
        if (std::all_of(pairs.begin(), pairs.end(),
                        [frame = frame](const auto& at) { return at.count(frame) > 0; }))
            common.push_back(frame);
    const int judged = std::min(max_frames, static_cast<int>(common.size()));
    std::vector<std::vector<double>> rows;
    for (int i = 0; i < judged; ++i) {
        const double spread =
            judged > 1 ? static_cast<double>(common.size() - 1) * i / (judged - 1) : 0.0;
        const int frame = common[static_cast<std::size_t>(std::nearbyint(spread))];
        std::map<std::pair<int, int>, double> scores;  // in order: neighbours share their files
        for (const auto& at : pairs) scores[at.at(frame)] = 0;
        bool whole = true;
        for (auto& [pair, value] : scores) {
            const std::optional<double> found = score(pair.first, pair.second);
            whole = found.has_value();
            if (!whole) break;
            value = *found;
        }
        if (!whole) continue;
        std::vector<double>& row = rows.emplace_back();
        for (const auto& at : pairs) row.push_back(scores.at(at.at(frame)));
    }
    return verdict(candidates, rows);
}

}  // namespace xcalib

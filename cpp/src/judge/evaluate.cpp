#include "xcalib/judge/evaluate.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <stdexcept>

#include "base/format.hpp"
#include "base/median.hpp"
#include "photometry/mat.hpp"
#include "xcalib/gray.hpp"
#include "xcalib/judge/metrics.hpp"
#include "xcalib/nec.hpp"
#include "xcalib/register.hpp"
#include "xcalib/verdict_on.hpp"

namespace xcalib {
namespace {

constexpr int kErosion = 2;  // valid pixels this close to an invalid one are not judged [px]
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kPatchMedian = 6, kPatchUnder2px = 7;

struct Size {
    int width, height;
};

Size reduced(int width, int height, int factor) {
    const auto side = [factor](int length) {
        return std::max(1, static_cast<int>(std::nearbyint(static_cast<double>(length) / factor)));
    };
    return {side(width), side(height)};
}

Image resized(const Image& image, const Size& size) {
    Image out(size.width, size.height);
    cv::Mat result = as_mat(out);
    cv::resize(as_mat(image), result, result.size(), 0, 0,
               size.width < image.width ? cv::INTER_AREA : cv::INTER_LINEAR);
    return out;
}

void set_patch_scores(const std::vector<double>& lengths, Scores& scores) {
    if (lengths.empty()) return;
    scores[kPatchMedian] = median(lengths);
    std::size_t under = 0;
    for (const double length : lengths) under += length < 2;
    scores[kPatchUnder2px] = static_cast<double>(under) / static_cast<double>(lengths.size());
}

// Scores of one frame; the lengths of its patch shifts are appended.
Scores scores_of(const Image& reference, const Image& image, const std::uint8_t* valid,
                 int num_threads, std::vector<double>& lengths) {
    std::vector<double> own;
    for (const PatchShift& s : patch_residual(reference, image, valid, num_threads))
        own.push_back(std::hypot(s.dx, s.dy));
    lengths.insert(lengths.end(), own.begin(), own.end());
    Scores scores{nec(reference, image, valid),
                  gc(reference, image, valid),
                  ssim(reference, image, valid, 1.0),
                  ncc(reference, image, valid),
                  rmse(reference, image, valid),
                  psnr(reference, image, valid, 1.0),
                  kNone,
                  kNone};
    set_patch_scores(own, scores);
    return scores;
}

// Means over the frames where a score is defined; patches of all frames count alike.
Scores pooled(const std::vector<Scores>& frames, const std::vector<double>& lengths) {
    Scores out;
    for (std::size_t i = 0; i < kScoreNames.size(); ++i) {
        double sum = 0;
        int count = 0;
        for (const Scores& frame : frames)
            if (std::isfinite(frame[i])) {
                sum += frame[i];
                ++count;
            }
        out[i] = count ? sum / count : kNone;
    }
    out[kPatchMedian] = out[kPatchUnder2px] = kNone;
    set_patch_scores(lengths, out);
    return out;
}

// To within a pixel.
void require_aspect(const ImageView& given, const ImageView& reference) {
    const long difference = static_cast<long>(given.width) * reference.height -
                            static_cast<long>(given.height) * reference.width;
    if (std::abs(difference) > std::max(reference.width, reference.height))
        throw std::invalid_argument(
            format("the registered image is %dx%d, expected the aspect of the reference's %dx%d",
                   given.width, given.height, reference.width, reference.height));
}

}  // namespace

double Evaluation::gain(std::size_t score) const {
    const double before = unregistered[score];
    return before != 0 ? 100 * (registered[score] - before) / std::abs(before) : kNone;
}

std::string Evaluation::table() const {
    struct Row {
        const char* label;
        double scale;
        int digits;
    };
    constexpr Row kRows[] = {{"NEC", 1, 4},
                             {"GC", 1, 4},
                             {"SSIM", 1, 4},
                             {"NCC", 1, 4},
                             {"RMSE", 1, 4},
                             {"PSNR [dB]", 1, 2},
                             {"patch median [px]", 1, 2},
                             {"patch < 2 px [%]", 100, 1}};
    const auto number = [](double value, int digits, bool sign = false) {
        return std::isnan(value) ? sign ? "-" : "nan"
                                 : format(sign ? "%+.*f" : "%.*f", digits, value);
    };
    std::string text = format("%-18s%14s%14s%12s%s\n", "", "unregistered", "registered",
                              "difference", given ? "       given  difference" : "");
    for (std::size_t i = 0; i < kScoreNames.size(); ++i) {
        const int digits = kRows[i].digits;
        const double before = kRows[i].scale * unregistered[i];
        const double after = kRows[i].scale * registered[i];
        text += format("%-18s%14s%14s%12s", kRows[i].label, number(before, digits).c_str(),
                       number(after, digits).c_str(), number(after - before, digits, true).c_str());
        if (given) {
            const double theirs = kRows[i].scale * (*given)[i];
            text += format("%12s%12s", number(theirs, digits).c_str(),
                           number(theirs - before, digits, true).c_str());
        }
        text += "\n";
    }
    return text + format("%zu frames at %dx%d, %.1f %% of the pixels judged", frames.size(), width,
                         height, 100 * valid_share);
}

std::string Evaluation::verdict_line() const {
    if (!verdict) return "";
    return std::string("on these frames: ") + (verdict->trusted ? "trusted: " : "NOT TRUSTED: ") +
           verdict->line();
}

std::string Evaluation::difference(const Rig& rig, const std::string& rig_file) const {
    if (!verdict || !rig.verdict || verdict->trusted == rig.verdict->trusted) return "";
    if (verdict->trusted)
        return rig_file + " is not to be trusted by its calibration, but is on these frames";
    return rig_file +
           " was trusted when it was calibrated, but is not on these frames: " + verdict->line();
}

namespace {

// Frames that a verdict rests on: as many as it needs of however many there are, spread over them,
// in constant memory.
class Sample {
   public:
    void add(const Image& reference, const Image& source, const ImageView& depth) {
        constexpr std::size_t kMost = 12;
        if (seen_++ % every_ != 0) return;
        if (references_.size() == kMost) {
            for (auto* list : {&references_, &sources_, &depths_}) {
                for (std::size_t i = 1; i < kMost / 2; ++i) (*list)[i] = std::move((*list)[2 * i]);
                list->resize(kMost / 2);
            }
            every_ *= 2;
            if ((seen_ - 1) % every_ != 0) return;
        }
        Image small = resize_depth(clean_depth(depth), reference.width, reference.height);
        const auto known = [](float z) { return z > 0; };
        if (std::none_of(small.pixels.begin(), small.pixels.end(), known)) return;
        references_.push_back(reference);
        sources_.push_back(source);
        depths_.push_back(std::move(small));
    }

    std::optional<Verdict> verdict(const Rig& rig, int num_threads) const {
        constexpr int kSmallest = 32;  // [px]: as a calibration wants them
        if (references_.size() < 2) return std::nullopt;
        for (const Image* image : {&references_[0], &sources_[0]})
            if (std::min(image->width, image->height) < kSmallest) return std::nullopt;
        const auto views = [](const std::vector<Image>& images) {
            std::vector<ImageView> out;
            for (const Image& image : images) out.push_back(image.view());
            return out;
        };
        return verdict_on(views(references_), views(sources_), views(depths_), rig, num_threads);
    }

   private:
    std::vector<Image> references_, sources_, depths_;
    std::size_t seen_ = 0, every_ = 1;
};

}  // namespace

struct Evaluator::State {
    Rig rig;
    int width, num_threads;
    std::optional<Registrar> registrar{};
    Size size{}, source_size{};
    std::vector<std::pair<Scores, Scores>> frames{};
    std::vector<Scores> given{};
    Sample sample{};
    std::vector<double> shares{}, lengths_after{}, lengths_before{}, lengths_given{};

    void open(const ImageView& reference, const ImageView& source) {
        const Rig full =
            fitted(rig, reference.width, reference.height, source.width, source.height);
        size = reduced(reference.width, reference.height, (reference.width + width - 1) / width);
        const Rig small = full.resized(size.width, size.height, source.width, source.height);
        // A source much finer than the grid would be sampled with aliasing.
        const int finer = std::max(1, static_cast<int>(small.source_density().x()));
        source_size = reduced(source.width, source.height, finer);
        RegistrarOptions options;
        options.num_threads = num_threads;
        registrar.emplace(
            full.resized(size.width, size.height, source_size.width, source_size.height), options);
    }
};

Evaluator::Evaluator(const Rig& rig, int width, int num_threads)
    : state_(new State{rig, width, num_threads}) {
    if (width < 1)
        throw std::invalid_argument("width is " + std::to_string(width) +
                                    ", expected at least 1 px");
}

Evaluator::~Evaluator() = default;

void Evaluator::add(const ImageView& reference, const ImageView& source, const ImageView& depth,
                    const ImageView* given) {
    State& s = *state_;
    if (!s.registrar) s.open(reference, source);
    if (given) require_aspect(*given, reference);
    const Image target = resized(known_gray(reference), s.size), plain = known_gray(source);
    Image registered(s.size.width, s.size.height);
    std::vector<std::uint8_t> codes(registered.pixels.size());
    const ImageView grid = registered.view();
    const Image source_image = resized(plain, s.source_size);
    s.sample.add(target, source_image, depth);
    s.registrar->register_frame(
        source_image.view(), depth,
        {registered.pixels.data(), grid.width, grid.height, 1, grid.type, grid.row_bytes},
        codes.data());
    cv::Mat mask(grid.height, grid.width, CV_8UC1, codes.data());
    mask = mask == 0;
    const int side = 2 * kErosion + 1;
    cv::erode(mask, mask, cv::Mat::ones(side, side, CV_8UC1));
    const int judged = cv::countNonZero(mask);
    s.shares.push_back(static_cast<double>(judged) / static_cast<double>(mask.total()));
    std::pair<Scores, Scores> scores;
    scores.first.fill(kNone);
    scores.second.fill(kNone);
    if (judged > 0) {
        scores.first = scores_of(target, registered, mask.data, s.num_threads, s.lengths_after);
        scores.second =
            scores_of(target, resized(plain, s.size), mask.data, s.num_threads, s.lengths_before);
    }
    s.frames.push_back(scores);
    if (!given) return;
    s.given.emplace_back().fill(kNone);
    if (judged > 0)
        s.given.back() = scores_of(target, resized(known_gray(*given), s.size), mask.data,
                                   s.num_threads, s.lengths_given);
}

Evaluation Evaluator::result(bool judge) const {
    const State& s = *state_;
    if (s.frames.empty()) throw std::invalid_argument("no frames to evaluate");
    Evaluation out;
    out.width = s.size.width;
    out.height = s.size.height;
    out.frames = s.frames;
    for (const double share : s.shares)
        out.valid_share += share / static_cast<double>(s.shares.size());
    std::vector<Scores> after, before;
    for (const auto& [registered, unregistered] : s.frames) {
        after.push_back(registered);
        before.push_back(unregistered);
    }
    out.registered = pooled(after, s.lengths_after);
    out.unregistered = pooled(before, s.lengths_before);
    if (judge) out.verdict = s.sample.verdict(s.rig, s.num_threads);
    if (s.given.empty()) return out;
    out.given = pooled(s.given, s.lengths_given);
    out.given_frames = s.given;
    return out;
}

}  // namespace xcalib

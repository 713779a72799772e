#include "xcalib/footage/choose.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <initializer_list>
#include <map>
#include <opencv2/imgproc.hpp>
#include <string_view>

#include "base/format.hpp"
#include "base/median.hpp"
#include "photometry/mat.hpp"
#include "xcalib/draw_frames.hpp"
#include "xcalib/gray.hpp"

namespace xcalib {
namespace {

constexpr int kCandidates = 4;           // looked at for each frame wanted, at most
constexpr int kWidth = 96;               // of the edge fields [px]
constexpr int kScales = 17;              // trial widths of the source's view on the reference,
constexpr double kSmallestScale = 0.4;   // equal fields of view at 1,
constexpr double kLargestScale = 2.5;    // geometric between these
constexpr int kPooled = 16;              // frames that vote on the one alignment, at most
constexpr int kFew = 8, kFewScales = 7;  // frames and scales that tell the mount
constexpr double kClear = 1.2;  // score of a mount above the next one's, from which it is the one
constexpr double kPrior = 0.1;  // known beforehand, as a share of what one frame adds
// Edges below this share of the median frame's: a closed shutter, or no light at all.
constexpr double kFlat = 0.15;
// Edges below this, in the image's units, are rounding: a constant image.
constexpr double kConstant = 1e-6;
// Share of pixels at the end of the range from which an image is not used.
constexpr double kSaturated = 0.5;
// Agreement of a pair below this share of the median pair's: not the same moment.
constexpr double kDisagrees = 0.25;
// Correlation of both edge fields with those of a frame already taken, from which it is one.
constexpr double kDuplicate = 0.97;

constexpr int kParameters = 11;
using Information = Eigen::Matrix<double, kParameters, kParameters>;

int rounded(double value) { return static_cast<int>(std::nearbyint(value)); }

cv::Mat as_mat(const EdgeMap& field) {
    return {field.height, field.width, CV_32FC2, const_cast<std::complex<float>*>(field.z.data())};
}

// -- One frame ------------------------------------------------------------------------------------

template <class T>
double share_at_end(const ImageView& image, bool both) {
    const int channel = image.channels == 3 ? 1 : 0;
    long top = 0, bottom = 0;
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) {
            const T value = image.row<T>(y)[x * image.channels + channel];
            top += value == std::numeric_limits<T>::max();
            bottom += value == 0;
        }
    return static_cast<double>(both ? std::max(top, bottom) : top) / image.width / image.height;
}

// Share of the pixels at the highest, or at either end of an integer type's range.
double share_at_end(const ImageView& image, bool both) {
    switch (image.type) {
        case PixelType::u8: return share_at_end<std::uint8_t>(image, both);
        case PixelType::u16: return share_at_end<std::uint16_t>(image, both);
        case PixelType::f32: break;
    }
    return 0.0;
}

struct Gradient {
    cv::Mat x, y;
};

Gradient gradient(const Image& image) {
    const int height =
        std::max(8, rounded(static_cast<double>(image.height) * kWidth / image.width));
    cv::Mat small;
    cv::resize(as_mat(image), small, {kWidth, height}, 0, 0, cv::INTER_AREA);
    const cv::Mat smooth = blurred(small, 0.7);
    Gradient out;
    cv::Sobel(smooth, out.x, CV_32F, 1, 0, 3, 1.0 / 8);
    cv::Sobel(smooth, out.y, CV_32F, 0, 1, 3, 1.0 / 8);
    return out;
}

double contrast(const Gradient& g) {
    return std::sqrt((g.x.dot(g.x) + g.y.dot(g.y)) / static_cast<double>(g.x.total()));
}

// m cos 2a + i m sin 2a, with m the gradient's length, a its angle. Doubling the angle makes
// opposite gradients the same, as thermal polarity wants, and lets edges that meet by chance
// cancel. m has a soft floor and a cap in units of its mean, and unit norm over the image.
EdgeMap edge_field(const Gradient& g) {
    cv::Mat length;
    cv::magnitude(g.x, g.y, length);
    const float mean = std::max(static_cast<float>(cv::mean(length)[0]), 1e-12f);
    EdgeMap field{g.x.cols, g.x.rows, std::vector<std::complex<float>>(g.x.total())};
    double energy = 0;
    for (int y = 0; y < field.height; ++y)
        for (int x = 0; x < field.width; ++x) {
            const float l = length.at<float>(y, x);
            const float m = std::max(std::min(l, 5 * mean) - mean, 0.0f);
            energy += static_cast<double>(m) * m;
            const float dx = g.x.at<float>(y, x), dy = g.y.at<float>(y, x);
            const float per = m / (std::max(l, 1e-12f) * std::max(l, 1e-12f));
            field.z[static_cast<std::size_t>(y) * field.width + x] = {per * (dx * dx - dy * dy),
                                                                      per * 2 * dx * dy};
        }
    const float norm = std::max(static_cast<float>(std::sqrt(energy)), 1e-12f);
    for (std::complex<float>& z : field.z) z /= norm;
    return field;
}

std::uint64_t hash_of(const ImageView& image) {
    const std::size_t bytes =
        static_cast<std::size_t>(image.width) * image.channels * bytes_per_channel(image.type);
    std::string rows;
    for (int y = 0; y < image.height; ++y) rows.append(image.row<char>(y), bytes);
    return std::hash<std::string_view>{}(rows);
}

// -- What is wrong with a frame beside the others -------------------------------------------------

bool usable(const Candidate& candidate) { return candidate.reason.empty(); }

// Correlation of two frames' edge fields of one camera, [-1, 1].
double likeness(const Candidate& one, const Candidate& other, int camera) {
    return as_mat(one.fields[camera]).dot(as_mat(other.fields[camera]));
}

bool twins(const Candidate& one, const Candidate& other) {
    return likeness(one, other, 0) > kDuplicate && likeness(one, other, 1) > kDuplicate;
}

void leave_bad_images(std::vector<Candidate>& candidates) {
    for (const int camera : {0, 1}) {
        std::vector<double> edges;
        for (const Candidate& c : candidates)
            if (usable(c)) edges.push_back(c.edges[camera]);
        if (edges.empty()) return;
        const double least = std::max(kFlat * median(std::move(edges)), kConstant);
        for (Candidate& c : candidates)
            if (usable(c) && !(c.edges[camera] > least))
                c.reason = camera ? "source is flat" : "reference is flat";
    }
    std::map<std::uint64_t, const Candidate*> first_with;
    for (Candidate& c : candidates) {
        if (!usable(c)) continue;
        const Candidate& first = *first_with.emplace(c.pixels, &c).first->second;
        // The same pixels twice beside a visible image that changed: the thermal stream hung. The
        // first may have been in time.
        if (&first != &c && likeness(c, first, 0) < kDuplicate)
            c.reason = "source is frozen since frame " + std::to_string(first.index) +
                       " (a shutter calibration, or a stream that hung)";
    }
}

// -- Where the two images' edges meet -------------------------------------------------------------

cv::Mat scaled(const cv::Mat& field, double scale) {
    cv::Mat out;
    cv::resize(field, out, {rounded(scale * field.cols), rounded(scale * field.rows)}, 0, 0,
               cv::INTER_AREA);
    return out;
}

cv::Mat spectrum(const cv::Mat& field, const cv::Size& size) {
    cv::Mat padded;
    cv::copyMakeBorder(field, padded, 0, size.height - field.rows, 0, size.width - field.cols,
                       cv::BORDER_CONSTANT);
    cv::dft(padded, padded, 0, field.rows);
    return padded;
}

// Sum over the pairs of the correlation at every shift of the second, circular.
cv::Mat correlation(const std::vector<cv::Mat>& a, const std::vector<cv::Mat>& b,
                    const cv::Size& size) {
    cv::Mat sum;
    for (std::size_t i = 0; i < a.size(); ++i) {
        cv::Mat product;
        cv::mulSpectrums(spectrum(a[i], size), spectrum(b[i], size), product, 0, true);
        if (sum.empty()) sum = product;
        else sum += product;
    }
    cv::Mat out;
    cv::dft(sum, out, cv::DFT_INVERSE | cv::DFT_SCALE);
    if (out.channels() == 2) cv::extractChannel(out, out, 0);  // Re conj(z_R) z_S
    return out;
}

cv::Mat energies(const std::vector<cv::Mat>& fields) {
    cv::Mat sum = cv::Mat::zeros(fields[0].size(), CV_32F);
    for (const cv::Mat& field : fields) {
        cv::Mat parts[2];
        cv::split(field, parts);
        sum += parts[0].mul(parts[0]) + parts[1].mul(parts[1]);
    }
    return sum;
}

// Normalized correlation of all pairs together at every shift of the sources, circular.
cv::Mat pooled_score(const std::vector<cv::Mat>& references, const std::vector<cv::Mat>& sources) {
    // Room for every shift at which the two overlap.
    const cv::Size size{cv::getOptimalDFTSize(references[0].cols + sources[0].cols),
                        cv::getOptimalDFTSize(references[0].rows + sources[0].rows)};
    const cv::Mat of_references = energies(references), of_sources = energies(sources);
    const auto ones = [](const cv::Mat& like) { return cv::Mat(like.size(), CV_32F, 1.0f); };
    cv::Mat seen = cv::max(correlation({of_references}, {ones(of_sources)}, size), 0);
    cv::Mat covered = cv::max(correlation({ones(of_references)}, {of_sources}, size), 0);
    cv::Mat norm;
    cv::sqrt(seen.mul(covered), norm);
    // A few edges in a narrow overlap agree easily: the floor makes them count for little.
    const double floor = 0.2 * std::sqrt(cv::sum(of_references)[0] * cv::sum(of_sources)[0]);
    return correlation(references, sources, size) / (norm + floor);
}

// How a source is mounted, roughly: quarter turns clockwise of its image, then its mirror.
struct Turn {
    int quarters = 0;
    bool mirrored = false;
};

// The edge field of the image turned and mirrored back: with a quarter turn doubled angles turn by
// a half, with a mirror they change their sign.
cv::Mat turned_back(const cv::Mat& field, const Turn& turn) {
    cv::Mat out = field.clone();
    if (turn.mirrored) {
        cv::flip(out, out, 1);
        out.forEach<cv::Vec2f>([](cv::Vec2f& z, const int*) { z[1] = -z[1]; });
    }
    constexpr int kBack[] = {0, cv::ROTATE_90_COUNTERCLOCKWISE, cv::ROTATE_180,
                             cv::ROTATE_90_CLOCKWISE};
    if (turn.quarters) cv::rotate(out, out, kBack[turn.quarters]);
    if (turn.quarters % 2) out = -out;
    return out;
}

// Where the sources lie on the references, by one scale and shift for all.
struct Alignment {
    Turn turn;
    double score = -INFINITY;  // normalized correlation, pooled
    double scale = 1.0;
    int x = 0, y = 0;  // [px of the fields]
};

// At most `count` of the candidates, spread over them.
std::vector<const Candidate*> some_of(const std::vector<Candidate*>& candidates,
                                      std::size_t count) {
    const std::size_t step = (candidates.size() + count - 1) / count;
    std::vector<const Candidate*> out;
    for (std::size_t i = 0; i < candidates.size(); i += step) out.push_back(candidates[i]);
    return out;
}

// Edge fields correlated at every shift by Fourier products, over a range of scales, pooled over
// the frames and divided by the norms in the overlap. Displacements by depth remain: the fields are
// coarse enough to bear them.
Alignment align(const std::vector<const Candidate*>& candidates, const Turn& turn, int scales) {
    std::vector<cv::Mat> references, fields;
    for (const Candidate* c : candidates) {
        references.push_back(as_mat(c->fields[0]));
        fields.push_back(turned_back(as_mat(c->fields[1]), turn));
    }
    const cv::Size grid = references[0].size();
    Alignment best;
    best.turn = turn;
    const double equal_width = static_cast<double>(grid.width) / fields[0].cols;
    for (int k = 0; k < scales; ++k) {
        const double scale = equal_width * kSmallestScale *
                             std::pow(kLargestScale / kSmallestScale, k / (scales - 1.0));
        std::vector<cv::Mat> sources;
        for (const cv::Mat& field : fields) sources.push_back(scaled(field, scale));
        const cv::Mat score = pooled_score(references, sources);
        double value = 0;
        cv::Point at;
        cv::minMaxLoc(score, nullptr, &value, nullptr, &at);
        if (value <= best.score) continue;
        best.score = value;
        best.scale = scale;
        // A shift beyond the reference is one to the left, or up, in a circular correlation.
        best.x = at.x >= grid.width ? at.x - score.cols : at.x;
        best.y = at.y >= grid.height ? at.y - score.rows : at.y;
    }
    return best;
}

// The alignment that suits the footage, and whether it stands out of what other mounts give by
// chance: where it does not, the mount is none of these.
std::pair<Alignment, bool> align(const std::vector<Candidate*>& candidates) {
    const std::vector<const Candidate*> few = some_of(candidates, kFew);
    std::vector<Alignment> turns;
    const auto clear = [&] {
        std::sort(turns.begin(), turns.end(),
                  [](const Alignment& a, const Alignment& b) { return a.score > b.score; });
        return turns[0].score > kClear * turns[1].score;
    };
    const auto look = [&](std::initializer_list<Turn> at) {
        for (const Turn& turn : at) turns.push_back(align(few, turn, kFewScales));
    };
    // Upright is the rule, and two others show what chance gives.
    look({{0, false}, {2, false}, {1, true}});
    if (!clear() || turns[0].turn.quarters || turns[0].turn.mirrored)
        look({{0, true}, {1, false}, {2, true}, {3, false}, {3, true}});
    const bool found = clear();
    return {align(some_of(candidates, kPooled), found ? turns[0].turn : Turn{}, kScales), found};
}

// Source edge fields on the reference grid.
std::vector<cv::Mat> aligned(const std::vector<Candidate*>& candidates, const Alignment& by) {
    const cv::Matx23f shift(1, 0, static_cast<float>(by.x), 0, 1, static_cast<float>(by.y));
    std::vector<cv::Mat> out;
    for (const Candidate* c : candidates) {
        out.emplace_back();
        cv::warpAffine(scaled(turned_back(as_mat(c->fields[1]), by.turn), by.scale), out.back(),
                       shift, as_mat(c->fields[0]).size());
    }
    return out;
}

void measure_agreement(const std::vector<Candidate*>& candidates,
                       const std::vector<cv::Mat>& sources) {
    for (std::size_t i = 0; i < candidates.size(); ++i) {
        const EdgeMap& reference = candidates[i]->fields[0];
        double overlapping = 0;
        for (int y = 0; y < reference.height; ++y)
            for (int x = 0; x < reference.width; ++x)
                if (sources[i].at<cv::Vec2f>(y, x) != cv::Vec2f(0, 0))
                    overlapping += std::norm(std::complex<double>(reference.row(y)[x]));
        const double norm = std::sqrt(overlapping) * cv::norm(sources[i]);
        candidates[i]->agreement = as_mat(reference).dot(sources[i]) / std::max(norm, 1e-12);
    }
}

void leave_disagreeing(const std::vector<Candidate*>& candidates) {
    std::vector<double> agreements;
    for (const Candidate* c : candidates) agreements.push_back(c->agreement);
    const double usual = median(std::move(agreements));
    for (Candidate* c : candidates)
        if (c->agreement < kDisagrees * usual)
            c->reason = "edges of the two images do not agree: out of sync, or too few";
}

// -- Taking the frames that add most --------------------------------------------------------------

// Information of one pair on the rig's 11 parameters, to a common factor: the Gauss-Newton matrix
// of the edge correlation at the identity. Common edges weigh |reference| |source|, and each sees
// the motion of its point along its own gradient.
Information information(const Candidate& candidate, const cv::Mat& source) {
    cv::Mat parts[2], seen;
    cv::split(source, parts);
    cv::magnitude(parts[0], parts[1], seen);
    cv::GaussianBlur(seen, seen, {}, 1.5);
    const EdgeMap& reference = candidate.fields[0];
    const Image& near = candidate.inverse_depth;
    const double half_width = reference.width / 2.0;
    Information sum = Information::Zero();
    for (int v = 0; v < reference.height; ++v)
        for (int u = 0; u < reference.width; ++u) {
            const std::complex<float> edge = reference.row(v)[u];
            const double weight = std::abs(edge) * seen.at<float>(v, u);
            if (!(weight > 0) || (!near.pixels.empty() && !(near.row(v)[u] > 0))) continue;
            const double half = 0.5 * std::arg(edge), nx = std::cos(half), ny = std::sin(half);
            const double x = (u - (reference.width - 1) / 2.0) / half_width;
            const double y = (v - (reference.height - 1) / 2.0) / half_width;
            // Inverse depth in units of 1/10 m, so that it spreads as the image coordinates do.
            const double z = near.pixels.empty() ? 0.5 : std::min(10.0 * near.row(v)[u], 3.0);
            const Eigen::Matrix<double, kParameters, 1> motion{nx,
                                                               ny,
                                                               nx * x,
                                                               ny * y,
                                                               nx * y,
                                                               ny * x - nx * y,
                                                               nx * x * x + ny * x * y,
                                                               nx * x * y + ny * y * y,
                                                               nx * z,
                                                               ny * z,
                                                               nx * x * z + ny * y * z};
            sum.noalias() += weight * motion * motion.transpose();
        }
    return sum;
}

double log_determinant(const Information& matrix) {
    const Eigen::PartialPivLU<Information> lu(matrix);
    return lu.matrixLU().diagonal().array().abs().log().sum();
}

void take_greedily(const std::vector<Candidate*>& candidates,
                   const std::vector<const cv::Mat*>& sources, int wanted) {
    std::vector<Information> informations;
    // A little is known of every parameter, or the first frames would all add without end.
    Information total = Information::Zero();
    for (std::size_t i = 0; i < candidates.size(); ++i) {
        informations.push_back(std::max(candidates[i]->agreement, 0.0) *
                               information(*candidates[i], *sources[i]));
        total.diagonal() += informations.back().diagonal();
    }
    total *= kPrior / static_cast<double>(candidates.size());
    const auto gain = [&](std::size_t i) {
        return log_determinant(total + informations[i]) - log_determinant(total);
    };
    std::vector<std::size_t> left(candidates.size()), taken;
    for (std::size_t i = 0; i < left.size(); ++i) left[i] = i;
    const auto twin_of = [&](std::size_t i) {
        return std::find_if(taken.begin(), taken.end(),
                            [&](std::size_t j) { return twins(*candidates[i], *candidates[j]); });
    };
    while (!left.empty() && static_cast<int>(taken.size()) < wanted) {
        std::vector<std::size_t> fresh;
        for (const std::size_t i : left)
            if (twin_of(i) == taken.end()) fresh.push_back(i);
        const std::vector<std::size_t>& open = fresh.empty() ? left : fresh;
        std::size_t best = open[0];
        double most = gain(best);
        for (std::size_t k = 1; k < open.size(); ++k)
            if (const double value = gain(open[k]); value > most) {
                most = value;
                best = open[k];
            }
        candidates[best]->gain = most;
        candidates[best]->taken = true;
        candidates[best]->reason = "adds most, number " + std::to_string(taken.size() + 1);
        total += informations[best];
        taken.push_back(best);
        left.erase(std::find(left.begin(), left.end(), best));
    }
    for (const std::size_t i : left) {
        candidates[i]->gain = gain(i);
        const auto twin = twin_of(i);
        candidates[i]->reason = twin == taken.end() ? "adds less than those taken"
                                                    : "near-duplicate of frame " +
                                                          std::to_string(candidates[*twin]->index);
    }
}

}  // namespace

std::vector<int> frames_to_look_at(int count, int max_frames, std::uint32_t seed) {
    if (count == 0) return {};
    return draw_frames(
        count, static_cast<int>(std::min<long>(kCandidates * long{max_frames}, count)), seed);
}

Candidate look_at(int index, const ImageView& reference, const ImageView& source,
                  const ImageView* depth) {
    Candidate found;
    found.index = index;
    Image dark, bright;
    for (const auto& [name, image, gray] :
         {std::tuple{"reference", &reference, &dark}, {"source", &source, &bright}})
        try {
            *gray = known_gray(*image);
        } catch (const std::invalid_argument& error) {
            found.reason = std::string(name) + ": " + error.what();
            return found;
        }
    // As the objective does, for the edges of a night image lie in its darkest tenth.
    if (reference.type != PixelType::f32)
        for (float& value : dark.pixels) value = std::log1p(20 * value);
    const Gradient gradients[2] = {gradient(dark), gradient(bright)};
    for (const int camera : {0, 1}) {
        found.edges[camera] = contrast(gradients[camera]);
        found.fields[camera] = edge_field(gradients[camera]);
    }
    found.pixels = hash_of(source);
    if (depth) {
        const Image metres = clean_depth(*depth);
        found.inverse_depth = Image(found.fields[0].width, found.fields[0].height);
        cv::Mat near = xcalib::as_mat(found.inverse_depth);
        cv::resize(xcalib::as_mat(metres), near, near.size(), 0, 0, cv::INTER_NEAREST);
        for (float& value : found.inverse_depth.pixels) value = value > 0 ? 1 / value : 0;
    }
    if (share_at_end(reference, false) > kSaturated) found.reason = "reference is saturated";
    if (share_at_end(source, true) > kSaturated) found.reason = "source is saturated";
    return found;
}

std::vector<Candidate> Choice::unusable() const {
    std::vector<Candidate> found;
    for (const Candidate& c : candidates)
        if (std::isnan(c.gain)) found.push_back(c);
    return found;
}

std::string Choice::table(const std::function<std::string(int)>& name) const {
    std::string text = format("%-24s%-7s%10s%8s  why", "frame", "", "agreement", "gain");
    const auto number = [](double value) {
        return std::isnan(value) ? std::string("-") : format("%.3f", value);
    };
    for (const Candidate& c : candidates)
        text += format("\n%-24s%-7s%10s%8s  %s", name(c.index).c_str(), c.taken ? "taken" : "left",
                       number(c.agreement).c_str(), number(c.gain).c_str(), c.reason.c_str());
    return text;
}

Choice choose(std::vector<Candidate> candidates, int max_frames) {
    leave_bad_images(candidates);
    std::vector<Candidate*> sound;
    for (Candidate& c : candidates)
        if (usable(c)) sound.push_back(&c);
    if (!sound.empty()) {
        const auto [alignment, clear] = align(sound);
        const std::vector<cv::Mat> sources = aligned(sound, alignment);
        measure_agreement(sound, sources);
        if (clear) leave_disagreeing(sound);
        std::vector<Candidate*> agreeing;
        std::vector<const cv::Mat*> theirs;
        for (std::size_t i = 0; i < sound.size(); ++i)
            if (usable(*sound[i])) {
                agreeing.push_back(sound[i]);
                theirs.push_back(&sources[i]);
            }
        take_greedily(agreeing, theirs, max_frames);
    }
    Choice choice;
    for (const Candidate& c : candidates)
        if (c.taken) choice.indices.push_back(c.index);
    std::sort(choice.indices.begin(), choice.indices.end());
    choice.candidates = std::move(candidates);
    return choice;
}

}  // namespace xcalib

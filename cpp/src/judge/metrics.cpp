#include "xcalib/judge/metrics.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "base/parallel.hpp"
#include "photometry/mat.hpp"

namespace xcalib {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

bool is_valid(const std::uint8_t* valid, std::size_t i) { return !valid || valid[i]; }

// Sums of two variables, for their correlation.
struct Correlation {
    double n = 0, a = 0, b = 0, aa = 0, bb = 0, ab = 0;

    void add(double x, double y) {
        n += 1;
        a += x;
        b += y;
        aa += x * x;
        bb += y * y;
        ab += x * y;
    }
    double value() const {
        if (n < 1) return kNaN;
        const double norm = (aa - a * a / n) * (bb - b * b / n);
        return norm > 0 ? std::clamp((ab - a * b / n) / std::sqrt(norm), -1.0, 1.0) : kNaN;
    }
};

void require_range(double data_range) {
    if (!(data_range > 0))
        throw std::invalid_argument("data_range is " + std::to_string(data_range) +
                                    ", expected > 0");
}

}  // namespace

double gc(const Image& reference, const Image& registered, const std::uint8_t* valid) {
    const int width = reference.width;
    Correlation along_x, along_y;
    for (int y = 0; y + 1 < reference.height; ++y)
        for (int x = 0; x + 1 < width; ++x) {
            const std::size_t i = static_cast<std::size_t>(y) * width + x;
            if (!(is_valid(valid, i) && is_valid(valid, i + 1) && is_valid(valid, i + width)))
                continue;
            const float* a = reference.pixels.data() + i;
            const float* b = registered.pixels.data() + i;
            along_x.add(std::abs(a[1] - a[0]), std::abs(b[1] - b[0]));
            along_y.add(std::abs(a[width] - a[0]), std::abs(b[width] - b[0]));
        }
    return 0.5 * (along_x.value() + along_y.value());
}

double ssim(const Image& reference, const Image& registered, const std::uint8_t* valid,
            double data_range) {
    require_range(data_range);
    constexpr double kSigma = 1.5;
    constexpr int kRadius = 5;  // 3.5 sigma, as scikit-image truncates it
    const double c1 = 0.01 * data_range * 0.01 * data_range;
    const double c2 = 0.03 * data_range * 0.03 * data_range;
    cv::Mat a, b;
    as_mat(reference).convertTo(a, CV_64F);
    as_mat(registered).convertTo(b, CV_64F);
    const auto smooth = [&](const cv::Mat& image) {
        cv::Mat out;
        cv::GaussianBlur(image, out, cv::Size(2 * kRadius + 1, 2 * kRadius + 1), kSigma, kSigma,
                         cv::BORDER_REFLECT);
        return out;
    };
    const cv::Mat ma = smooth(a), mb = smooth(b);
    const cv::Mat aa = smooth(a.mul(a)), bb = smooth(b.mul(b)), ab = smooth(a.mul(b));
    // A pixel counts where the whole window lies inside the image and is valid.
    cv::Mat inside(reference.height, reference.width, CV_8U, cv::Scalar(255));
    if (valid)
        for (std::size_t i = 0; i < reference.pixels.size(); ++i)
            inside.data[i] = valid[i] ? 255 : 0;
    cv::erode(inside, inside,
              cv::getStructuringElement(cv::MORPH_RECT, cv::Size(2 * kRadius + 1, 2 * kRadius + 1)),
              cv::Point(-1, -1), 1, cv::BORDER_CONSTANT, cv::Scalar(0));
    double sum = 0;
    std::size_t count = 0;
    for (int y = 0; y < reference.height; ++y)
        for (int x = 0; x < reference.width; ++x) {
            if (!inside.at<std::uint8_t>(y, x)) continue;
            const double ua = ma.at<double>(y, x), ub = mb.at<double>(y, x);
            const double va = aa.at<double>(y, x) - ua * ua, vb = bb.at<double>(y, x) - ub * ub;
            const double vab = ab.at<double>(y, x) - ua * ub;
            sum +=
                (2 * ua * ub + c1) * (2 * vab + c2) / ((ua * ua + ub * ub + c1) * (va + vb + c2));
            ++count;
        }
    return count > 0 ? std::min(1.0, sum / static_cast<double>(count)) : kNaN;
}

double ncc(const Image& reference, const Image& registered, const std::uint8_t* valid) {
    Correlation correlation;
    for (std::size_t i = 0; i < reference.pixels.size(); ++i)
        if (is_valid(valid, i)) correlation.add(reference.pixels[i], registered.pixels[i]);
    return correlation.value();
}

double rmse(const Image& reference, const Image& registered, const std::uint8_t* valid) {
    double sum = 0;
    std::size_t count = 0;
    for (std::size_t i = 0; i < reference.pixels.size(); ++i) {
        if (!is_valid(valid, i)) continue;
        const double d = double(reference.pixels[i]) - registered.pixels[i];
        sum += d * d;
        ++count;
    }
    return count > 0 ? std::sqrt(sum / static_cast<double>(count)) : kNaN;
}

double psnr(const Image& reference, const Image& registered, const std::uint8_t* valid,
            double data_range) {
    require_range(data_range);
    return 20 * std::log10(data_range / rmse(reference, registered, valid));
}

namespace {

constexpr int kPatch = 48, kStep = 32, kReach = 14, kBins = 6;
constexpr int kOwnPeak = 5;          // [px] around the peak that is its own
constexpr double kStandsOut = 0.03;  // above everything further away

// 6 maps of gradient magnitude by unsigned orientation, clamped and blurred.
std::array<cv::Mat, kBins> orientation_energy(const cv::Mat& image) {
    const cv::Mat smooth = blurred(image, 1.0);
    cv::Mat gx, gy;
    const cv::Mat central_x = (cv::Mat_<float>(1, 3) << -0.5f, 0, 0.5f);
    cv::filter2D(smooth, gx, CV_32F, central_x);
    cv::filter2D(smooth, gy, CV_32F, central_x.t());
    cv::Mat magnitude;
    cv::magnitude(gx, gy, magnitude);
    const float limit = static_cast<float>(4 * cv::mean(magnitude)[0]);
    std::array<cv::Mat, kBins> maps;
    for (cv::Mat& map : maps) map = cv::Mat::zeros(image.size(), CV_32F);
    constexpr float kPi = 3.14159265f;
    for (int y = 0; y < image.rows; ++y)
        for (int x = 0; x < image.cols; ++x) {
            float angle = std::atan2(gy.at<float>(y, x), gx.at<float>(y, x));
            if (angle < 0) angle += kPi;
            // Shared between the two nearest bins, so that no edge jumps from one to the next.
            const float place = angle / kPi * kBins;
            const int low = static_cast<int>(place);
            const float part = place - static_cast<float>(low);
            const float energy = std::min(magnitude.at<float>(y, x), limit);
            maps[low % kBins].at<float>(y, x) += (1 - part) * energy;
            maps[(low + 1) % kBins].at<float>(y, x) += part * energy;
        }
    for (cv::Mat& map : maps) map = blurred(map, 1.0);
    return maps;
}

double parabola_peak(double left, double here, double right) {
    const double curvature = left - 2 * here + right;
    return curvature < 0 ? std::clamp(0.5 * (left - right) / curvature, -0.5, 0.5) : 0.0;
}

// Normalized correlation of a patch with the window around it, over all bins at once.
cv::Mat patch_scores(const std::array<cv::Mat, kBins>& a, const std::array<cv::Mat, kBins>& b,
                     const cv::Rect& patch, const cv::Rect& window) {
    const double count = kBins * kPatch * kPatch;
    cv::Mat cross, sum, square;
    double mean_a = 0, energy_a = 0;
    for (int k = 0; k < kBins; ++k) {
        const cv::Mat t = a[k](patch), w = b[k](window);
        mean_a += cv::sum(t)[0] / count;
        energy_a += t.dot(t);
        cv::Mat part, part_sum, part_square;
        cv::matchTemplate(w, t, part, cv::TM_CCORR);
        cv::Mat s, q;
        cv::integral(w, s, q, CV_64F, CV_64F);
        part_sum = s(cv::Rect(kPatch, kPatch, part.cols, part.rows)) -
                   s(cv::Rect(0, kPatch, part.cols, part.rows)) -
                   s(cv::Rect(kPatch, 0, part.cols, part.rows)) +
                   s(cv::Rect(0, 0, part.cols, part.rows));
        part_square = q(cv::Rect(kPatch, kPatch, part.cols, part.rows)) -
                      q(cv::Rect(0, kPatch, part.cols, part.rows)) -
                      q(cv::Rect(kPatch, 0, part.cols, part.rows)) +
                      q(cv::Rect(0, 0, part.cols, part.rows));
        if (k == 0) {
            part.convertTo(cross, CV_64F);
            sum = part_sum;
            square = part_square;
        } else {
            cv::add(cross, part, cross, cv::noArray(), CV_64F);
            sum += part_sum;
            square += part_square;
        }
    }
    const double variance_a = energy_a - count * mean_a * mean_a;
    cv::Mat scores(cross.size(), CV_64F, cv::Scalar(-1));
    for (int y = 0; y < scores.rows; ++y)
        for (int x = 0; x < scores.cols; ++x) {
            const double s = sum.at<double>(y, x);
            const double variance_b = square.at<double>(y, x) - s * s / count;
            const double norm = variance_a * variance_b;
            if (norm > 0)
                scores.at<double>(y, x) = (cross.at<double>(y, x) - mean_a * s) / std::sqrt(norm);
        }
    return scores;
}

}  // namespace

std::vector<PatchShift> patch_residual(const Image& reference, const Image& registered,
                                       const std::uint8_t* valid, int num_threads) {
    // Night images keep their edges in the lowest values.
    cv::Mat compressed = 1 + 20 * as_mat(reference);
    cv::max(compressed, 1e-6, compressed);
    cv::log(compressed, compressed);
    compressed /= std::log(21.0);
    const auto a = orientation_energy(compressed);
    const auto b = orientation_energy(as_mat(registered));
    cv::Mat invalid;
    if (valid) {
        cv::Mat outside(reference.height, reference.width, CV_8U);
        for (std::size_t i = 0; i < reference.pixels.size(); ++i)
            outside.data[i] = valid[i] ? 0 : 1;
        cv::integral(outside, invalid, CV_32S);
    }
    // At least this share of a patch, and of the window that it moves in, must be valid.
    constexpr double kMissing = 0.25;
    const auto places = [](int size) {
        const int room = size - kPatch - 2 * kReach;
        return room < 0 ? 0 : room / kStep + 1;
    };
    const int rows = places(reference.height), columns = places(reference.width);
    std::vector<std::vector<PatchShift>> found(rows);
    parallel_ranges(rows, num_threads, [&](int begin, int end) {
        for (int row = begin; row < end; ++row)
            for (int column = 0; column < columns; ++column) {
                const cv::Rect patch(kReach + column * kStep, kReach + row * kStep, kPatch, kPatch);
                const cv::Rect window(patch.x - kReach, patch.y - kReach, kPatch + 2 * kReach,
                                      kPatch + 2 * kReach);
                if (valid) {
                    const int missing =
                        invalid.at<int>(window.br()) - invalid.at<int>(window.y, window.br().x) -
                        invalid.at<int>(window.br().y, window.x) + invalid.at<int>(window.tl());
                    if (missing > kMissing * window.area()) continue;
                }
                const cv::Mat scores = patch_scores(a, b, patch, window);
                double best = 0;
                cv::Point at;
                cv::minMaxLoc(scores, nullptr, &best, nullptr, &at);
                if (at.x == 0 || at.y == 0 || at.x == 2 * kReach || at.y == 2 * kReach)
                    continue;  // no peak, an edge of the search
                double elsewhere = -1;
                for (int y = 0; y < scores.rows; ++y)
                    for (int x = 0; x < scores.cols; ++x)
                        if (std::hypot(x - at.x, y - at.y) > kOwnPeak)
                            elsewhere = std::max(elsewhere, scores.at<double>(y, x));
                if (best - elsewhere < kStandsOut) continue;
                const auto score = [&](int y, int x) { return scores.at<double>(y, x); };
                PatchShift shift;
                shift.center_x = static_cast<float>(patch.x + (kPatch - 1) / 2.0);
                shift.center_y = static_cast<float>(patch.y + (kPatch - 1) / 2.0);
                shift.dx = static_cast<float>(
                    at.x - kReach +
                    parabola_peak(score(at.y, at.x - 1), best, score(at.y, at.x + 1)));
                shift.dy = static_cast<float>(
                    at.y - kReach +
                    parabola_peak(score(at.y - 1, at.x), best, score(at.y + 1, at.x)));
                found[row].push_back(shift);
            }
    });
    std::vector<PatchShift> shifts;
    for (const auto& part : found) shifts.insert(shifts.end(), part.begin(), part.end());
    return shifts;
}

}  // namespace xcalib

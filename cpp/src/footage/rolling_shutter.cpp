#include "xcalib/footage/rolling_shutter.hpp"

#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "base/format.hpp"
#include "base/parallel.hpp"
#include "base/workers.hpp"
#include "footage/source_trials.hpp"
#include "geometry/projector.hpp"
#include "photometry/mat.hpp"
#include "xcalib/error.hpp"

namespace xcalib {
namespace {

constexpr int kLevels[] = {2, 1};  // of the fits
// The NEC falls by about as much for each share that rows are off, but at the very peak; and by up
// to half as much for each share that they are moved, since motion is not known well at edges of
// depth. Found on four rendered drives.
constexpr double kPeak = 0.15, kMaxCost = 0.5;
constexpr double kModelError = 0.08;  // of the share, by what the above does not say
constexpr double kDeviations = 2.0;   // that the share is above 0

int cv_type(PixelType type, int channels) {
    const int depth = type == PixelType::u8 ? CV_8U : type == PixelType::u16 ? CV_16U : CV_32F;
    return CV_MAKETYPE(depth, channels);
}

cv::Mat resized(const Image& image, int width, int height) {
    cv::Mat out;
    cv::resize(as_mat(image), out, cv::Size(width, height), 0, 0, cv::INTER_LINEAR);
    return out;
}

// The share at which the NEC would be largest if moving rows cost nothing.
double share_of(const std::vector<double>& shares, const std::vector<double>& nec) {
    const auto count = static_cast<Eigen::Index>(shares.size());
    const Eigen::Map<const Eigen::ArrayXd> s(shares.data(), count);
    const Eigen::Map<const Eigen::VectorXd> values(nec.data(), count);
    double least = INFINITY, found = 0;
    for (double share = -0.3; share <= 1.1; share += 0.01) {
        const Eigen::VectorXd off = ((s - share).square() + kPeak * kPeak).sqrt() - kPeak;
        const Eigen::VectorXd off_and_cost = off.array() + kMaxCost * s.abs();
        // Neither may count less than nothing: at most one of them is then left out.
        for (const int columns : {3, 1, 2}) {
            Eigen::MatrixXd model(count, 1 + (columns & 1) + columns / 2);
            model.col(0).setOnes();
            if (columns & 1) model.col(1) = -off;
            if (columns & 2) model.rightCols<1>() = -off_and_cost;
            const Eigen::VectorXd weights = model.colPivHouseholderQr().solve(values);
            if ((weights.tail(model.cols() - 1).array() < 0).any()) continue;
            const double residual = (model * weights - values).squaredNorm();
            if (residual < least) {
                least = residual;
                found = share;
            }
            if (columns == 3) break;  // as good as any
        }
    }
    return found;
}

// Means over the frames, without one of them.
std::vector<double> means(const std::vector<std::vector<double>>& nec, std::size_t without) {
    std::vector<double> out;
    for (const std::vector<double>& frames : nec) {
        double sum = 0;
        for (std::size_t i = 0; i < frames.size(); ++i)
            if (i != without) sum += frames[i];
        out.push_back(sum / static_cast<double>(frames.size() - (without < frames.size())));
    }
    return out;
}

}  // namespace

std::optional<double> parse_readout(const std::string& option, const std::string& text) {
    if (text == "auto") return std::nullopt;
    char* end = nullptr;
    const double share = std::strtod(text.c_str(), &end);
    if (text.empty() || *end != '\0' || !(share >= 0 && share <= 1))
        throw InputError(option + " " + text +
                         ": expected the share of the time from frame to frame over which rows are "
                         "read, 0 to 1, or auto");
    return share;
}

RowDelay row_delay(const Readout& readout, const std::optional<Rig>& rig, int width, int height) {
    // The first row is read at 0, the last at the readout.
    const double last = std::max(height - 1, 1);
    RowDelay delay{0, 0, readout.source / last};
    if (readout.reference == 0) return delay;
    if (!rig) {
        delay.per_row -= readout.reference / last;
        return delay;
    }
    // Around the reference's middle.
    constexpr double kFar = 1e6;  // [m], so that the baseline does not count
    const Pinhole& reference = rig->reference;
    const double x = 0.5 * (reference.width - 1), y = 0.5 * (reference.height - 1);
    const double step = 0.25 * std::min(reference.width, reference.height);
    const auto at = [&](double column, double row) { return transfer(*rig, column, row, kFar); };
    const Eigen::Vector2d middle = at(x, y);
    Eigen::Matrix2d slopes;
    slopes << (at(x + step, y) - at(x - step, y)) / (2 * step),
        (at(x, y + step) - at(x, y - step)) / (2 * step);
    const Eigen::RowVector2d row = slopes.inverse().row(1);  // of the reference, by source px
    if (!row.allFinite()) return delay;
    const double per_row = readout.reference / std::max(reference.height - 1, 1);
    const Pinhole& source = rig->source;
    delay.at -= per_row * (y - row * middle);
    delay.per_column -= per_row * row.x() * source.width / width;
    delay.per_row -= per_row * row.y() * source.height / height;
    return delay;
}

void straighten(const ImageView& image, const Motion& motion, const RowDelay& delay, bool nearest,
                const MutableImageView& out) {
    cv::Mat x = resized(motion.x, image.width, image.height),
            y = resized(motion.y, image.width, image.height);
    for (int v = 0; v < image.height; ++v) {
        auto *x_row = x.ptr<float>(v), *y_row = y.ptr<float>(v);
        for (int u = 0; u < image.width; ++u) {
            const auto late = static_cast<float>(delay(u, v));
            x_row[u] = static_cast<float>(u) + late * x_row[u];
            y_row[u] = static_cast<float>(v) + late * y_row[u];
        }
    }
    const int type = cv_type(image.type, image.channels);
    const cv::Mat from(image.height, image.width, type, const_cast<void*>(image.data),
                       static_cast<std::size_t>(image.row_bytes));
    cv::Mat to(out.height, out.width, type, out.data, static_cast<std::size_t>(out.row_bytes));
    cv::remap(from, to, x, y, nearest ? cv::INTER_NEAREST : cv::INTER_CUBIC, cv::BORDER_REPLICATE);
}

double ReadoutFit::taken() const { return std::min(std::round(100 * share) / 100, 1.0); }

std::string ReadoutFit::line(const std::string& camera) const {
    if (shares.empty()) return "the footage is too short to tell the readout of the " + camera;
    if (!seen) return "no rolling shutter of the " + camera + " is seen";
    return format(
        "the %s reads its rows over %.2f +- %.2f of the time from frame to frame, which is taken "
        "up; give --%s-readout %.2f to the other commands",
        camera.c_str(), taken(), error, camera.c_str(), taken());
}

ReadoutFit fit_readout(const std::vector<ImageView>& references,
                       const std::vector<ImageView>& depths, const std::vector<SourcesAtShare>& at,
                       const Rig& rig, const CalibrationOptions& options) {
    if (at.size() < 5 || at.size() % 2 == 0 || at[at.size() / 2].share != 0)
        throw std::invalid_argument(
            format("%zu shares, expected an odd number from 5 on, 0 in their middle", at.size()));
    const WorkersOfThread workers(resolve_threads(options.num_threads));
    const SourceTrials trials(references, at[at.size() / 2].sources, depths, rig, options);
    ReadoutFit fit;
    for (const SourcesAtShare& here : at) {
        if (here.sources.size() != references.size())
            throw std::invalid_argument(
                format("share %g has %zu sources, expected one for each of %zu references",
                       here.share, here.sources.size(), references.size()));
        fit.shares.push_back(here.share);
    }
    // Outwards from 0, each from the last one's rig.
    fit.nec.resize(at.size());
    const std::size_t middle = at.size() / 2;
    for (const int way : {-1, 1}) {
        Rig last = trials.rig();
        for (std::size_t i = middle; i < at.size(); i += static_cast<std::size_t>(way)) {
            Trial trial = trials.start(at[i].sources);
            for (const int factor : kLevels) {
                trials.refit(factor, {last}, trial);
                last = trial.rig;
            }
            fit.nec[i] = std::move(trial.nec);
        }
    }
    const std::size_t count = references.size();
    fit.share = share_of(fit.shares, means(fit.nec, count));
    double squares = 0;
    for (std::size_t i = 0; i < count; ++i) {
        const double without = share_of(fit.shares, means(fit.nec, i)) - fit.share;
        squares += without * without;
    }
    fit.error = std::hypot(kModelError, std::sqrt(squares * static_cast<double>(count - 1) /
                                                  static_cast<double>(count)));
    fit.seen = fit.share > kDeviations * fit.error;
    return fit;
}

}  // namespace xcalib

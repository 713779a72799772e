#include "xcalib/search.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <map>
#include <mutex>
#include <opencv2/core.hpp>

#include "base/parallel.hpp"
#include "objective/edge_sample.hpp"

namespace xcalib {
namespace {

using Complex = std::complex<float>;

// A map of viewing directions: pan = step (x - center_x), Mercator ordinate step (y - center_y).
struct DirectionMap {
    double step;  // [rad / px]
    int width, height;
    double center_x() const { return 0.5 * (width - 1); }
    double center_y() const { return 0.5 * (height - 1); }
    // The direction of a map pixel, not normalized.
    Eigen::Vector3d ray(int x, int y) const {
        const double pan = step * (x - center_x()), ordinate = step * (y - center_y());
        return {std::sin(pan), std::sinh(ordinate), std::cos(pan)};
    }
};

constexpr double kSteepest = 6;  // tangent of the tilt that maps end at: 80 deg

// The map that holds the camera's whole image, at the given step.
DirectionMap map_for(const Pinhole& camera, double step) {
    const Pinhole::Field field = camera.field();
    DirectionMap map;
    map.step = step;
    map.width =
        2 * static_cast<int>(std::ceil(std::atan(std::max(-field.left, field.right)) / step)) + 1;
    // Mercator's ordinate grows without end: a fisheye's border is left out.
    const double steepest = std::min(kSteepest, std::max(-field.top, field.bottom));
    map.height = 2 * static_cast<int>(std::ceil(std::asinh(steepest) / step)) + 1;
    return map;
}

// Where each map pixel looks in the image (negative: outside), and exp(-2 i phi) for the angle phi
// by which the image shows the map's directions turned.
struct MapSampler {
    std::vector<float> u, v;
    std::vector<Complex> turn;
};

MapSampler map_sampler(const DirectionMap& map, const Pinhole& camera,
                       const Eigen::Matrix3d& camera_from_map) {
    MapSampler sampler;
    const std::size_t size = static_cast<std::size_t>(map.width) * map.height;
    sampler.u.assign(size, -1.0f);
    sampler.v.assign(size, -1.0f);
    sampler.turn.resize(size);
    for (int y = 0; y < map.height; ++y)
        for (int x = 0; x < map.width; ++x) {
            const Eigen::Vector3d ray = camera_from_map * map.ray(x, y);
            if (ray.z() < 0.05 * ray.norm()) continue;
            const Eigen::Vector2d p = project(camera, ray);
            if (!(p.x() >= 0 && p.x() <= camera.width - 1 && p.y() >= 0 &&
                  p.y() <= camera.height - 1))
                continue;
            const Eigen::Vector2d beside = project(camera, camera_from_map * map.ray(x + 1, y)) - p;
            if (!beside.allFinite()) continue;  // the lens shows nothing there
            const std::size_t i = static_cast<std::size_t>(y) * map.width + x;
            sampler.u[i] = static_cast<float>(p.x());
            sampler.v[i] = static_cast<float>(p.y());
            const Complex direction(static_cast<float>(beside.x() / beside.norm()),
                                    static_cast<float>(-beside.y() / beside.norm()));
            sampler.turn[i] = product(direction, direction);
        }
    return sampler;
}

// Edges drawn on a map, with unit energy over it, so that all frames weigh alike.
std::vector<Complex> draw(const EdgeMap& edges, const MapSampler& sampler) {
    std::vector<Complex> drawn(sampler.u.size());
    double energy = 0;
    for (std::size_t i = 0; i < drawn.size(); ++i) {
        if (sampler.u[i] < 0) continue;
        drawn[i] = product(bilinear(edges, sampler.u[i], sampler.v[i]).value, sampler.turn[i]);
        energy += std::norm(drawn[i]);
    }
    const float scale = energy > 0 ? static_cast<float>(1 / std::sqrt(energy)) : 0.0f;
    for (Complex& z : drawn) z *= scale;
    return drawn;
}

using Spectrum = cv::Mat;  // CV_32FC2

Spectrum spectrum_of(const Complex* values, const DirectionMap& map, cv::Size size) {
    cv::Mat padded = cv::Mat::zeros(size, CV_32FC2);
    for (int y = 0; y < map.height; ++y)
        std::copy_n(values + static_cast<std::size_t>(y) * map.width, map.width,
                    padded.ptr<Complex>(y));
    cv::dft(padded, padded, 0, map.height);
    return padded;
}

// The spectra of two real maps, by one transform of both.
std::array<Spectrum, 2> spectra_of(const std::vector<Complex>& both, const DirectionMap& map,
                                   cv::Size size) {
    const Spectrum joint = spectrum_of(both.data(), map, size);
    std::array<Spectrum, 2> out{Spectrum(size, CV_32FC2), Spectrum(size, CV_32FC2)};
    for (int y = 0; y < size.height; ++y) {
        const Complex* here = joint.ptr<Complex>(y);
        const Complex* mirrored = joint.ptr<Complex>(y > 0 ? size.height - y : 0);
        Complex* real = out[0].ptr<Complex>(y);
        Complex* imaginary = out[1].ptr<Complex>(y);
        for (int x = 0; x < size.width; ++x) {
            const Complex a = here[x], b = std::conj(mirrored[x > 0 ? size.width - x : 0]);
            real[x] = 0.5f * (a + b);
            const Complex difference = 0.5f * (a - b);
            imaginary[x] = {difference.imag(), -difference.real()};
        }
    }
    return out;
}

// All that one hypothesis of a camera gives: a spectrum per frame, and the pooled energy and mask.
struct CameraSpectra {
    std::vector<Spectrum> frames;
    Spectrum energy, mask;
    double total_energy = 0;
};

CameraSpectra camera_spectra(const std::vector<EdgeMap>& images, const DirectionMap& map,
                             const Pinhole& camera, const Eigen::Matrix3d& camera_from_map,
                             cv::Size size) {
    CameraSpectra out;
    const MapSampler sampler = map_sampler(map, camera, camera_from_map);
    std::vector<Complex> both(sampler.u.size());  // energy and mask
    for (const EdgeMap& image : images) {
        const std::vector<Complex> drawn = draw(image, sampler);
        for (std::size_t i = 0; i < both.size(); ++i) both[i] += std::norm(drawn[i]);
        out.frames.push_back(spectrum_of(drawn.data(), map, size));
    }
    for (std::size_t i = 0; i < both.size(); ++i) {
        out.total_energy += both[i].real();
        if (sampler.u[i] >= 0) both[i].imag(1.0f);
    }
    auto [energy, mask] = spectra_of(both, map, size);
    out.energy = energy;
    out.mask = mask;
    return out;
}

// The spectrum of corr[shift] = sum_x conj(a[x]) b[x + shift], added to `sum`.
void add_product(const Spectrum& a, const Spectrum& b, Spectrum& sum) {
    for (int y = 0; y < a.rows; ++y) {
        const Complex* pa = a.ptr<Complex>(y);
        const Complex* pb = b.ptr<Complex>(y);
        Complex* ps = sum.ptr<Complex>(y);
        for (int x = 0; x < a.cols; ++x)
            ps[x] += Complex(pa[x].real() * pb[x].real() + pa[x].imag() * pb[x].imag(),
                             pa[x].real() * pb[x].imag() - pa[x].imag() * pb[x].real());
    }
}

cv::Mat inverse(Spectrum& spectrum) {
    cv::Mat out;
    cv::dft(spectrum, out, cv::DFT_INVERSE | cv::DFT_SCALE);
    return out;
}

struct Peak {
    std::size_t reference, source, roll;
    double dx, dy;  // source map - reference map, from centre to centre [px]
    double score, correlation, overlap;
};

// A displacement of the map as a rotation: source_map_from_reference_map.
Eigen::Matrix3d rotation_of_shift(double dx, double dy, double step) {
    const double pan = dx * step;
    const double tilt = 2 * std::atan(std::tanh(dy * step / 4)) * 2;  // 2 gd(dy step / 2)
    // A point moves right (+x) by a turn about +y and down (+y) by a turn about -x.
    return (Eigen::AngleAxisd(-tilt, Eigen::Vector3d::UnitX()) *
            Eigen::AngleAxisd(pan, Eigen::Vector3d::UnitY()))
        .toRotationMatrix();
}

double parabola_offset(double left, double here, double right) {
    const double curvature = left - 2 * here + right;
    return curvature < 0 ? std::clamp(0.5 * (left - right) / curvature, -0.5, 0.5) : 0.0;
}

std::vector<Peak> peaks_of(const CameraSpectra& reference, const CameraSpectra& source,
                           const DirectionMap& reference_map, const DirectionMap& source_map,
                           cv::Size size, const SearchSpace& space) {
    Spectrum sum = cv::Mat::zeros(size, CV_32FC2), energies = cv::Mat::zeros(size, CV_32FC2);
    for (std::size_t i = 0; i < reference.frames.size(); ++i)
        add_product(reference.frames[i], source.frames[i], sum);
    // Both norms in one transform: the reference's in the real part, the source's in the other.
    Spectrum norm_s = cv::Mat::zeros(size, CV_32FC2);
    add_product(reference.energy, source.mask, energies);
    add_product(reference.mask, source.energy, norm_s);
    for (int y = 0; y < size.height; ++y) {
        Complex* e = energies.ptr<Complex>(y);
        const Complex* s = norm_s.ptr<Complex>(y);
        for (int x = 0; x < size.width; ++x) e[x] += Complex(-s[x].imag(), s[x].real());
    }
    const cv::Mat numerator = inverse(sum), norms = inverse(energies);
    // Correlation index 0 puts the maps' first pixels on one another.
    const double off_x = source_map.center_x() - reference_map.center_x();
    const double off_y = source_map.center_y() - reference_map.center_y();
    const double limit = space.max_shift > 0 ? space.max_shift * reference_map.width : 1e9;
    const auto signed_shift = [](int i, int n, int first) { return i >= first ? i - n : i; };
    cv::Mat score(size, CV_32F, cv::Scalar(-1)), overlap(size, CV_32F, cv::Scalar(0));
    std::vector<float> typical;
    for (int y = 0; y < size.height; ++y)
        for (int x = 0; x < size.width; ++x) {
            const int sx = signed_shift(x, size.width, source_map.width);
            const int sy = signed_shift(y, size.height, source_map.height);
            if (std::abs(sx - off_x) > limit || std::abs(sy - off_y) > limit) continue;
            const Complex norm = norms.at<Complex>(y, x);
            const double share_r = std::max(0.0, norm.real() / reference.total_energy);
            const double share_s = std::max(0.0, norm.imag() / source.total_energy);
            const double both = std::sqrt(share_r * share_s);
            if (both < space.options.min_overlap) continue;
            const double value = numerator.at<Complex>(y, x).real() /
                                 (both * std::sqrt(reference.total_energy * source.total_energy));
            score.at<float>(y, x) = static_cast<float>(value);
            overlap.at<float>(y, x) = static_cast<float>(both);
            typical.push_back(static_cast<float>(value));
        }
    if (typical.size() < 9) return {};
    std::nth_element(typical.begin(), typical.begin() + typical.size() / 2, typical.end());
    const double median = typical[typical.size() / 2];
    // Chance matches grow as the overlap shrinks: what counts is how much of both images agrees.
    const auto z = [&](int y, int x) {
        return (score.at<float>(y, x) - median) * overlap.at<float>(y, x);
    };
    std::vector<Peak> peaks;
    const auto wrap = [](int i, int n) { return (i + n) % n; };
    for (int y = 0; y < size.height; ++y)
        for (int x = 0; x < size.width; ++x) {
            const float here = score.at<float>(y, x);
            if (here <= median) continue;
            const float l = score.at<float>(y, wrap(x - 1, size.width));
            const float r = score.at<float>(y, wrap(x + 1, size.width));
            const float u = score.at<float>(wrap(y - 1, size.height), x);
            const float d = score.at<float>(wrap(y + 1, size.height), x);
            if (!(here > l && here >= r && here > u && here >= d)) continue;
            if (std::min({l, r, u, d}) < 0) continue;  // at the rim of what is allowed
            Peak peak{};
            peak.dx =
                signed_shift(x, size.width, source_map.width) - off_x + parabola_offset(l, here, r);
            peak.dy = signed_shift(y, size.height, source_map.height) - off_y +
                      parabola_offset(u, here, d);
            peak.score = z(y, x);
            peak.correlation = here;
            peak.overlap = overlap.at<float>(y, x);
            peaks.push_back(peak);
        }
    const auto better = [](const Peak& a, const Peak& b) { return a.score > b.score; };
    const std::size_t keep = std::min<std::size_t>(peaks.size(), 4);
    std::partial_sort(peaks.begin(), peaks.begin() + keep, peaks.end(), better);
    peaks.resize(keep);
    return peaks;
}

std::vector<EdgeMap> reduced_for(const std::vector<EdgeMap>& maps, double factor) {
    std::vector<EdgeMap> out;
    for (const EdgeMap& map : maps)
        out.push_back(reduced(map, std::max(8, static_cast<int>(std::lround(map.width / factor))),
                              std::max(8, static_cast<int>(std::lround(map.height / factor)))));
    return out;
}

// Do two candidates lie in one basin? Compared by where they send the reference's inner points.
double distance(const Rig& a, const Rig& b) {
    const auto far = [](const Rig& rig, double x, double y) -> Eigen::Vector2d {
        return project(rig.source, rig.R() * unproject(rig.reference, x, y, 1));
    };
    double sum = 0;
    int count = 0;
    for (double y : {0.3, 0.5, 0.7})
        for (double x : {0.3, 0.5, 0.7}) {
            const double u = x * a.reference.width, v = y * a.reference.height;
            const double apart = (far(a, u, v) - far(b, u, v)).norm();
            if (std::isnan(apart)) continue;  // a lens shows nothing there
            sum += apart;
            ++count;
        }
    return count > 0 ? sum / count / a.source.width : 1;
}

}  // namespace

std::vector<SearchCandidate> global_search(const std::vector<EdgeMap>& references,
                                           const std::vector<EdgeMap>& sources,
                                           const SearchSpace& space, int num_threads) {
    struct Trial {
        std::size_t source, roll;
        double best = 0.0;  // score of a peak
    };
    std::vector<Trial> promising;  // of the first hypothesis
    // One source pixel a map pixel: finer would alias. The same for all hypotheses.
    std::vector<std::vector<EdgeMap>> reduced_sources;

    std::vector<Peak> all;
    std::vector<double> steps;
    std::mutex mutex;
    const std::vector<EdgeMap> reference_maps =
        reduced_for(references, static_cast<double>(references[0].width) / space.options.map_width);
    for (std::size_t r = 0; r < space.hypotheses.size(); ++r) {
        const SearchHypothesis& hypothesis = space.hypotheses[r];
        const std::size_t cameras = hypothesis.sources.size();
        std::vector<Trial> trials;
        for (const Trial& trial : promising)
            if (trial.source < cameras) trials.push_back(trial);
        for (std::size_t s = reduced_sources.size(); s < cameras; ++s)
            for (std::size_t k = 0; k < space.rolls.size(); ++k) trials.push_back({s, k});
        const Pinhole camera =
            hypothesis.reference.resized(reference_maps[0].width, reference_maps[0].height);
        const double step = 1 / camera.pixels_per_radian().x();
        steps.push_back(step);
        const DirectionMap map = map_for(camera, step);
        std::vector<DirectionMap> source_maps;
        for (const Pinhole& source : hypothesis.sources)
            source_maps.push_back(map_for(source, step));
        // Few transform sizes, so that the reference's spectra serve many source cameras.
        const auto transform_size = [&](const Trial& trial) {
            const DirectionMap& source_map = source_maps[trial.source];
            const auto round_up = [](int n) { return cv::getOptimalDFTSize((n + 31) / 32 * 32); };
            return std::array<int, 2>{round_up(map.width + source_map.width),
                                      round_up(map.height + source_map.height)};
        };
        std::map<std::array<int, 2>, CameraSpectra> reference_spectra;
        for (const Trial& trial : trials) reference_spectra[transform_size(trial)];
        std::vector<std::array<int, 2>> sizes;
        for (const auto& [size, spectra] : reference_spectra) sizes.push_back(size);
        parallel_each(static_cast<int>(sizes.size()), num_threads, [&](int i) {
            reference_spectra[sizes[i]] =
                camera_spectra(reference_maps, map, camera, Eigen::Matrix3d::Identity(),
                               cv::Size(sizes[i][0], sizes[i][1]));
        });
        const std::size_t known = reduced_sources.size();
        reduced_sources.resize(std::max(known, cameras));
        parallel_each(static_cast<int>(reduced_sources.size() - known), num_threads, [&](int i) {
            const Pinhole& source = hypothesis.sources[known + i];
            reduced_sources[known + i] = reduced_for(
                sources, source.pixels_per_radian().x() / source.width * sources[0].width * step);
        });
        parallel_each(static_cast<int>(trials.size()), num_threads, [&](int i) {
            Trial& trial = trials[i];
            const std::vector<EdgeMap>& images = reduced_sources[trial.source];
            const Pinhole source_camera =
                hypothesis.sources[trial.source].resized(images[0].width, images[0].height);
            const Eigen::Matrix3d source_from_map =
                space.base * Eigen::AngleAxisd(space.rolls[trial.roll], Eigen::Vector3d::UnitZ())
                                 .toRotationMatrix();
            const auto size = transform_size(trial);
            const cv::Size cv_size(size[0], size[1]);
            const DirectionMap& source_map = source_maps[trial.source];
            const CameraSpectra spectra =
                camera_spectra(images, source_map, source_camera, source_from_map, cv_size);
            std::vector<Peak> peaks =
                peaks_of(reference_spectra.at(size), spectra, map, source_map, cv_size, space);
            trial.best = peaks.empty() ? 0.0 : peaks[0].score;
            const std::lock_guard<std::mutex> lock(mutex);
            for (Peak& peak : peaks) {
                peak.reference = r;
                peak.source = trial.source;
                peak.roll = trial.roll;
                all.push_back(peak);
            }
        });
        if (r == 0) {
            // The field of view of the reference bends the map towards its rim, but hardly changes
            // which scale and roll agree.
            constexpr std::size_t kMin = 12, kPart = 3;
            const auto better = [](const Trial& a, const Trial& b) { return a.best > b.best; };
            std::stable_sort(trials.begin(), trials.end(), better);
            trials.resize(std::min(trials.size(), std::max(kMin, trials.size() / kPart)));
            promising = trials;
        }
    }
    // Threads append in any order; the order here must not depend on it.
    std::sort(all.begin(), all.end(), [](const Peak& a, const Peak& b) {
        if (a.score != b.score) return a.score > b.score;
        return std::tie(a.reference, a.source, a.roll, a.dx, a.dy) <
               std::tie(b.reference, b.source, b.roll, b.dx, b.dy);
    });
    std::vector<SearchCandidate> kept;
    for (const Peak& peak : all) {
        if (static_cast<int>(kept.size()) >= space.options.candidates) break;
        SearchCandidate candidate;
        candidate.rig.reference = space.hypotheses[peak.reference].reference;
        candidate.rig.source = space.hypotheses[peak.reference].sources[peak.source];
        candidate.rig.source_from_reference.rotation = Eigen::Quaterniond(
            space.base *
            Eigen::AngleAxisd(space.rolls[peak.roll], Eigen::Vector3d::UnitZ()).toRotationMatrix() *
            rotation_of_shift(peak.dx, peak.dy, steps[peak.reference]));
        candidate.score = peak.score;
        candidate.correlation = peak.correlation;
        candidate.overlap = peak.overlap;
        const bool known = std::any_of(kept.begin(), kept.end(), [&](const SearchCandidate& k) {
            return distance(k.rig, candidate.rig) < 0.03;
        });
        if (!known) kept.push_back(candidate);
    }
    return kept;
}

}  // namespace xcalib

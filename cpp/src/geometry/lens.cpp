#include "xcalib/lens.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <stdexcept>
#include <string>

#include "base/format.hpp"
#include "xcalib/error.hpp"

namespace xcalib {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kQuarterTurn = 1.57079632679489661923;

// Polynomials by ascending powers.
using Polynomial = std::vector<double>;

Polynomial derivative_of(const Polynomial& p) {
    Polynomial out(std::max<std::size_t>(1, p.size() - 1), 0.0);
    for (std::size_t i = 1; i < p.size(); ++i) out[i - 1] = static_cast<double>(i) * p[i];
    return out;
}

Polynomial product(const Polynomial& a, const Polynomial& b) {
    Polynomial out(a.size() + b.size() - 1, 0.0);
    for (std::size_t i = 0; i < a.size(); ++i)
        for (std::size_t j = 0; j < b.size(); ++j) out[i + j] += a[i] * b[j];
    return out;
}

// The first place in [low, high] where a polynomial, given by its Bernstein coefficients there, is
// no longer positive. These bound it: where all are positive, so is it; else halves are looked at.
double first_root(const Polynomial& bernstein, double low, double high) {
    constexpr double kNarrow = 1e-15;
    if (std::all_of(bernstein.begin(), bernstein.end(), [](double b) { return b > 0; }))
        return kInfinity;
    if (!(bernstein.front() > 0) || high - low < kNarrow) return low;
    Polynomial left(bernstein.size()), right = bernstein;
    for (std::size_t n = right.size(), i = 0; i < n; ++i) {  // de Casteljau
        left[i] = right[0];
        for (std::size_t k = 0; k + i + 1 < n; ++k) right[k] = 0.5 * (right[k] + right[k + 1]);
    }
    const double middle = 0.5 * (low + high);
    const double root = first_root(left, low, middle);
    return root < kInfinity ? root : first_root(right, middle, high);
}

// The first s > 0 where the polynomial is no longer positive. On t = s / (1 + s) in [0, 1] its
// coefficients by Bernstein's polynomials are those by powers over the binomials.
double first_root(Polynomial p) {
    while (p.size() > 1 && p.back() == 0) p.pop_back();  // these would be roots at infinity
    const std::size_t degree = p.size() - 1;
    double binomial = 1;
    for (std::size_t i = 0; i <= degree; ++i) {
        p[i] /= binomial;
        binomial *= static_cast<double>(degree - i) / static_cast<double>(i + 1);
    }
    const double t = first_root(p, 0, 1);
    return t < 1 ? t / (1 - t) : kInfinity;
}

const char* const kBrownNames[] = {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"};
const char* const kFisheyeNames[] = {"k1", "k2", "k3", "k4"};

}  // namespace

const char* name_of(LensModel model) {
    switch (model) {
        case LensModel::none: return "none";
        case LensModel::brown: return "brown";
        case LensModel::fisheye: return "fisheye";
    }
    return "";
}

std::optional<LensModel> lens_model_of(const std::string& name) {
    for (const LensModel model : {LensModel::none, LensModel::brown, LensModel::fisheye})
        if (name == name_of(model)) return model;
    return std::nullopt;
}

Lens::Lens(LensModel model, const std::vector<double>& coefficients)
    : model_(model), count_(coefficients.size()) {
    const auto refuse = [&](const char* expected) {
        throw std::invalid_argument(format("a lens of model %s has %zu coefficients, expected %s",
                                           name_of(model), coefficients.size(), expected));
    };
    if (model == LensModel::none && count_ != 0) refuse("0");
    if (model == LensModel::brown && count_ != 4 && count_ != 5 && count_ != 8)
        refuse("4 (k1 k2 p1 p2), 5 (... k3) or 8 (... k4 k5 k6)");
    if (model == LensModel::fisheye && count_ != 4) refuse("4 (k1 k2 k3 k4)");
    std::copy(coefficients.begin(), coefficients.end(), coefficients_.begin());
    const bool finite = std::all_of(coefficients.begin(), coefficients.end(),
                                    [](double c) { return std::isfinite(c); });
    const auto& c = coefficients_;
    bends_ = model == LensModel::fisheye ||
             std::any_of(c.begin(), c.end(), [](double value) { return value != 0; });
    rational_ = model == LensModel::brown && (c[5] != 0 || c[6] != 0 || c[7] != 0);
    if (!bends_ || !finite) return;  // validate() refuses the latter
    if (model == LensModel::fisheye) {
        const double s = first_root({1, 3 * c[0], 5 * c[1], 7 * c[2], 9 * c[3]});  // theta^2
        if (s < kQuarterTurn * kQuarterTurn) max_radius_ = std::tan(std::sqrt(s));
        return;
    }
    // r' = r N(s) / D(s), s = r^2: dr'/dr = ((N + 2 s N') D - 2 s N D') / D^2.
    const Polynomial n{1, c[0], c[1], c[4]}, d{1, c[5], c[6], c[7]}, twice{0, 2};
    Polynomial rises = product(n, d);
    const Polynomial more = product(twice, product(derivative_of(n), d));
    const Polynomial less = product(twice, product(n, derivative_of(d)));
    for (std::size_t i = 0; i < rises.size(); ++i) rises[i] += more[i] - less[i];
    max_radius_ = std::sqrt(std::min(first_root(rises), first_root(d)));
}

Lens::Radial Lens::radial(double r2) const {
    const auto& c = coefficients_;
    if (model_ == LensModel::fisheye) {
        const double r = std::sqrt(r2);
        if (r < 1e-4) return {1 + r2 * (c[0] - 1.0 / 3), c[0] - 1.0 / 3};
        const double theta = std::atan(r), s = theta * theta;
        const double f = theta * (1 + s * (c[0] + s * (c[1] + s * (c[2] + s * c[3])))) / r;
        const double rise = 1 + s * (3 * c[0] + s * (5 * c[1] + s * (7 * c[2] + s * 9 * c[3])));
        return {f, (rise / (1 + r2) - f) / (2 * r2)};
    }
    const double n = 1 + r2 * (c[0] + r2 * (c[1] + r2 * c[4]));
    const double rise = c[0] + r2 * (2 * c[1] + r2 * 3 * c[4]);
    if (!rational_) return {n, rise};
    const double d = 1 + r2 * (c[5] + r2 * (c[6] + r2 * c[7]));
    return {n / d, (rise - n / d * (c[5] + r2 * (2 * c[6] + r2 * 3 * c[7]))) / d};
}

// p1 and p2, which a fisheye has none of, in other words: with h = f + 2 (p1 y + p2 x),
// x' = x h + p2 r2 and y' = y h + p1 r2.
Eigen::Vector2d Lens::shown(const Eigen::Vector2d& point) const {
    const double r2 = point.squaredNorm(), f = radial(r2).f;
    if (model_ != LensModel::brown) return f * point;
    const double p1 = coefficients_[2], p2 = coefficients_[3];
    const double h = f + 2 * (p1 * point.y() + p2 * point.x());
    return {point.x() * h + p2 * r2, point.y() * h + p1 * r2};
}

std::optional<Eigen::Vector2d> Lens::distort(const Eigen::Vector2d& point) const {
    if (!bends_) return point;
    if (!(point.squaredNorm() < max_radius_ * max_radius_)) return std::nullopt;
    return shown(point);
}

Eigen::Matrix2d Lens::derivative(const Eigen::Vector2d& point) const {
    if (!bends_) return Eigen::Matrix2d::Identity();
    const Radial radial = this->radial(point.squaredNorm());
    const bool brown = model_ == LensModel::brown;
    const Eigen::Vector2d p(brown ? coefficients_[3] : 0, brown ? coefficients_[2] : 0);  // p2 p1
    const double h = radial.f + 2 * p.dot(point);
    // x' = x h + p2 r2: dx' = h dx + x dh + p2 dr2
    Eigen::Matrix2d out = h * Eigen::Matrix2d::Identity() +
                          point * (2 * radial.slope * point + 2 * p).transpose() +
                          p * (2 * point).transpose();
    return out;
}

// Of a point on a line through the axis, without p1 and p2: r f grows up to max_radius.
std::optional<double> Lens::radius_of(double shown) const {
    const auto at = [&](double r) { return r * radial(r * r).f; };
    double low = 0, high = max_radius_;
    if (high < kInfinity) {
        if (!(shown < at(high))) return std::nullopt;
    } else {
        constexpr double kFar = 1e8;
        for (high = std::max(shown, 1e-9); !(at(high) >= shown); high *= 2)
            if (!(high < kFar)) return std::nullopt;
    }
    // Newton's steps, unless they leave what is known to hold the radius: then halves of that.
    double r = std::min(shown, 0.5 * (low + high));
    for (int i = 0; i < 100; ++i) {
        const Radial f = radial(r * r);
        const double excess = r * f.f - shown;
        (excess > 0 ? high : low) = r;
        if (std::abs(excess) <= 1e-15 * shown || high - low <= 1e-16 * high) break;
        const double slope = f.f + 2 * r * r * f.slope, next = r - excess / slope;
        r = next > low && next < high ? next : 0.5 * (low + high);
    }
    return r;
}

std::optional<Eigen::Vector2d> Lens::undistort(const Eigen::Vector2d& shown) const {
    if (!bends_) return shown;
    const double r = shown.norm();
    if (r == 0 && coefficients_[2] == 0 && coefficients_[3] == 0) return shown;
    const bool tangential =
        model_ == LensModel::brown && (coefficients_[2] != 0 || coefficients_[3] != 0);
    const std::optional<double> radius = r > 0 ? radius_of(r) : 0.0;
    if (!tangential) {
        if (!radius) return std::nullopt;
        return shown * (*radius / r);
    }
    // p1 and p2 move the border of what is shown, so a start just within it will do.
    const double start = radius.value_or(0.99 * max_radius_);
    if (!(start < kInfinity)) return std::nullopt;
    Eigen::Vector2d point = r > 0 ? Eigen::Vector2d(shown * (start / r)) : shown;
    double error = (this->shown(point) - shown).norm();
    for (int i = 0; i < 50 && error > 1e-15; ++i) {
        Eigen::Vector2d step = derivative(point).inverse() * (this->shown(point) - shown);
        bool nearer = false;  // by a shorter step if need be, and not across the border
        for (int halvings = 0; halvings < 20 && !nearer; ++halvings, step *= 0.5) {
            const Eigen::Vector2d next = point - step;
            if (!(next.norm() < max_radius_)) continue;
            const double then = (this->shown(next) - shown).norm();
            nearer = then < error;
            if (!nearer) continue;
            point = next;
            error = then;
        }
        if (!nearer) break;
    }
    if (!(error <= 1e-9 * std::max(1.0, r))) return std::nullopt;
    return point;
}

Lens Lens::flipped() const {
    if (model_ != LensModel::brown) return *this;
    Lens out = *this;  // the radius stays
    out.coefficients_[3] = -coefficients_[3];
    return out;
}

std::optional<Lens> Lens::parse(const std::string& option, const std::string& word) {
    if (word == "auto") return std::nullopt;
    const auto bad = [&](const std::string& why) {
        return InputError(option + " is '" + word +
                          "', expected auto, none, brown:K1,K2,P1,P2[,K3[,K4,K5,K6]] or "
                          "fisheye:K1,K2,K3,K4" +
                          why);
    };
    const std::size_t colon = word.find(':');
    const std::optional<LensModel> model = lens_model_of(word.substr(0, colon));
    if (!model || (*model == LensModel::none) != (colon == std::string::npos)) throw bad("");
    std::vector<double> coefficients;
    for (const char* at = word.c_str() + std::min(colon, word.size()); *at != '\0';) {
        char* end = nullptr;
        const double value = std::strtod(++at, &end);
        if (end == at || (*end != ',' && *end != '\0') || !std::isfinite(value))
            throw bad(": finite numbers between commas");
        coefficients.push_back(value);
        at = end;
    }
    try {
        return Lens(*model, coefficients);
    } catch (const std::invalid_argument& error) {
        throw bad(std::string(": ") + error.what());
    }
}

std::string Lens::word(const std::optional<Lens>& lens) {
    if (!lens) return "auto";
    std::string word = name_of(lens->model_);
    for (std::size_t i = 0; i < lens->count_; ++i)
        word += format("%s%.10g", i == 0 ? ":" : ",", lens->coefficients_[i]);
    return word;
}

bool Lens::operator==(const Lens& other) const {
    return model_ == other.model_ && count_ == other.count_ && coefficients_ == other.coefficients_;
}

void Lens::validate(const char* name) const {
    const char* const* names = model_ == LensModel::fisheye ? kFisheyeNames : kBrownNames;
    for (std::size_t i = 0; i < count_; ++i)
        if (!std::isfinite(coefficients_[i]))
            throw std::invalid_argument(format("%s: lens %s = %g, expected a finite number", name,
                                               names[i], coefficients_[i]));
}

}  // namespace xcalib

// What a lens does to the image of a pinhole: OpenCV's models, in its order of coefficients.
//
// Coordinates are normalized: (X/Z, Y/Z) before the lens, and after it what K takes to pixels. With
// r2 = x^2 + y^2,
//   brown:   x' = x f + 2 p1 x y + p2 (r2 + 2 x^2), y' = y f + p1 (r2 + 2 y^2) + 2 p2 x y,
//            f = (1 + k1 r2 + k2 r2^2 + k3 r2^3) / (1 + k4 r2 + k5 r2^2 + k6 r2^3);
//   fisheye: (x', y') = (x, y) f, f = theta (1 + k1 theta^2 + ... + k4 theta^8) / r, theta = atan
//   r.
// Beyond the radius where f r stops growing a polynomial folds the image back over itself, which no
// lens does: points out there have no image.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "xcalib/export.hpp"

namespace XCALIB_EXPORT xcalib {

enum class LensModel { none, brown, fisheye };

class Lens {
   public:
    static constexpr std::size_t kMaxCoefficients = 8;

    Lens() = default;  // none
    // none: no coefficients; brown: k1 k2 p1 p2 [k3 [k4 k5 k6]]; fisheye: k1 k2 k3 k4. Throws
    // std::invalid_argument where there are more or fewer.
    Lens(LensModel model, const std::vector<double>& coefficients);

    LensModel model() const { return model_; }
    std::vector<double> coefficients() const {  // as many as were given
        return {coefficients_.begin(), coefficients_.begin() + count_};
    }
    double coefficient(int i) const { return coefficients_[i]; }  // 0 where not given

    // Is there anything to do? A fisheye always bends.
    bool bends() const { return bends_; }
    // Of a brown: is there more than a polynomial, k4 to k6?
    bool is_rational() const { return rational_; }
    // Points that lie farther from the axis, before the lens, have no image.
    double max_radius() const { return max_radius_; }

    // Where the lens shows a point, and where it has a point that it shows.
    std::optional<Eigen::Vector2d> distort(const Eigen::Vector2d& point) const;
    std::optional<Eigen::Vector2d> undistort(const Eigen::Vector2d& shown) const;

    // d distort / d point. Symmetric.
    Eigen::Matrix2d derivative(const Eigen::Vector2d& point) const;

    // The same lens seen through its image flipped left to right.
    Lens flipped() const;

    // Throws std::invalid_argument naming `name`, the coefficient, its value and what was expected.
    void validate(const char* name) const;

    // "none", "brown:K1,K2,P1,P2[,K3[,K4,K5,K6]]" or "fisheye:K1,K2,K3,K4", or "auto": none given.
    // Throws InputError, naming `option`, where it is none of these.
    static std::optional<Lens> parse(const std::string& option, const std::string& word);
    // What parse() takes for it.
    static std::string word(const std::optional<Lens>& lens);

    bool operator==(const Lens& other) const;
    bool operator!=(const Lens& other) const { return !(*this == other); }

   private:
    // f, and df / dr2.
    struct Radial {
        double f, slope;
    };
    Radial radial(double r2) const;
    Eigen::Vector2d shown(const Eigen::Vector2d& point) const;
    std::optional<double> radius_of(double shown) const;

    LensModel model_ = LensModel::none;
    std::size_t count_ = 0;
    bool bends_ = false, rational_ = false;
    std::array<double, kMaxCoefficients> coefficients_{};
    double max_radius_ = std::numeric_limits<double>::infinity();
};

// "none", "brown", "fisheye", and back; none of the models where it is no name of one.
const char* name_of(LensModel model);
std::optional<LensModel> lens_model_of(const std::string& name);

}  // namespace xcalib

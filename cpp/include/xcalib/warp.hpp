// Depth-guided reprojection, Eq. (3d_mapping): where each reference pixel lies in the source image,
// how that place moves with the parameters, and bilinear sampling there.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>

#include "xcalib/camera.hpp"
#include "xcalib/image.hpp"

namespace xcalib {

// What a registered pixel is worth: the codes of every mask that leaves this library.
enum class Validity : std::uint8_t { valid = 0, outside = 1, occluded = 2, no_depth = 3 };

// Eq. (3d_wrapper) times the depth: x_S = pi(D h x~ + k).
struct Reprojection {
    Eigen::Matrix3d h;  // infinite homography
    Eigen::Vector3d k;  // K_S t
    int source_width = 0;
    int source_height = 0;

    explicit Reprojection(const Rig& rig);
};

// A point nearer to the source camera's plane than this has no stable projection. [m]
inline constexpr double kNearestZ = 1e-3;

// So far beyond the outermost pixel centres a point still counts as on them: a pixel on the rim
// stays there whatever the last bit of a rounding says. [px]
inline constexpr float kRim = 1e-3f;

// One row: source coordinates [px] of the reference pixels (0..width-1, y), and their validity.
// Coordinates of pixels that are not valid are NaN.
void map_row(const Reprojection& reprojection, const float* depth, int y, int width, float* u,
             float* v, std::uint8_t* validity);

// The parameters of a rig in the order of every Jacobian of this library, scaled as
// SolverParameters: source camera, rotation (R <- exp(w) R), translation, reference camera.
// clang-format off
enum Parameter : int {
    kSourceLogFx, kSourceLogFy, kSourceCx, kSourceCy, kSourceSkew,
    kRotationX, kRotationY, kRotationZ,
    kTranslationX, kTranslationY, kTranslationZ,
    kReferenceLogFx, kReferenceLogFy, kReferenceCx, kReferenceCy, kReferenceSkew,
    kNumParameters
};
// clang-format on
inline constexpr int kNumWithoutReference = kReferenceLogFx;

// Chain rule through Eq. (3d_mapping): the derivative of any f(x_S), given df/du and df/dv, by the
// parameters. kCount is kNumWithoutReference or kNumParameters.
class ProjectionDerivative {
   public:
    explicit ProjectionDerivative(const Rig& rig)
        : R_(rig.R().cast<float>()), t_(rig.t().cast<float>()), reference_(rig.reference),
          fx_(static_cast<float>(rig.source.fx)), fy_(static_cast<float>(rig.source.fy)),
          skew_(static_cast<float>(rig.source.skew)), width_(static_cast<float>(rig.source.width)),
          height_(static_cast<float>(rig.source.height)) {}

    // `ray` is the reference pixel's normalized ray (x, y, 1), `depth` its depth [m].
    // Writes out[p * stride] for p in 0..kCount-1.
    template <int kCount>
    void chain(float ray_x, float ray_y, float depth, float df_du, float df_dv, float* out,
               int stride) const {
        const float xr = depth * ray_x, yr = depth * ray_y;
        const float rx = R_(0, 0) * xr + R_(0, 1) * yr + R_(0, 2) * depth;  // R X_R
        const float ry = R_(1, 0) * xr + R_(1, 1) * yr + R_(1, 2) * depth;
        const float rz = R_(2, 0) * xr + R_(2, 1) * yr + R_(2, 2) * depth;
        const float inverse_z = 1.0f / (rz + t_.z());
        const float x = (rx + t_.x()) * inverse_z, y = (ry + t_.y()) * inverse_z;
        const float dx = df_du * fx_;                  // df/dx, x = X_S / Z_S
        const float dy = df_du * skew_ + df_dv * fy_;  // df/dy
        out[kSourceLogFx * stride] = dx * x;
        out[kSourceLogFy * stride] = df_dv * fy_ * y;
        out[kSourceCx * stride] = df_du * width_;
        out[kSourceCy * stride] = df_dv * height_;
        out[kSourceSkew * stride] = df_du * width_ * y;
        const float qx = dx * inverse_z, qy = dy * inverse_z;  // df/dX_S
        const float qz = -(qx * x + qy * y);
        out[kRotationX * stride] = ry * qz - rz * qy;  // q . (w x R X_R) = w . (R X_R x q)
        out[kRotationY * stride] = rz * qx - rx * qz;
        out[kRotationZ * stride] = rx * qy - ry * qx;
        out[kTranslationX * stride] = qx;
        out[kTranslationY * stride] = qy;
        out[kTranslationZ * stride] = qz;
        if constexpr (kCount == kNumParameters) {
            const float ex = depth * (R_(0, 0) * qx + R_(1, 0) * qy + R_(2, 0) * qz);  // df/d ray
            const float ey = depth * (R_(0, 1) * qx + R_(1, 1) * qy + R_(2, 1) * qz);
            const float fx = static_cast<float>(reference_.fx);
            const float fy = static_cast<float>(reference_.fy);
            const float skew = static_cast<float>(reference_.skew);
            const float w = static_cast<float>(reference_.width);
            const float h = static_cast<float>(reference_.height);
            out[kReferenceLogFx * stride] = -ex * ray_x;
            // fx ray_x = u - cx - skew ray_y: ray_y's part does not scale with fx.
            out[kReferenceLogFy * stride] = (ex * skew / fx - ey) * ray_y;
            out[kReferenceCx * stride] = -ex * w / fx;
            out[kReferenceCy * stride] = (ex * skew / fx - ey) * h / fy;
            out[kReferenceSkew * stride] = -ex * ray_y * w / fx;
        }
    }

   private:
    Eigen::Matrix3f R_;
    Eigen::Vector3f t_;
    Pinhole reference_;
    float fx_, fy_, skew_, width_, height_;
};

// dT/dp at one reference pixel, (2 x kNumParameters) [px per unit parameter].
Eigen::Matrix<double, 2, kNumParameters> warp_jacobian(const Rig& rig, double x, double y,
                                                       double depth);

// A source image on the reference grid. `validity` holds Validity codes, one per pixel.
struct WarpedImage {
    Image image;
    std::vector<std::uint8_t> validity;
};
WarpedImage warp(const Rig& rig, const Image& source, const Image& depth);

}  // namespace xcalib

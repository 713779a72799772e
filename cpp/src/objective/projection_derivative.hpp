// How the place of a reference pixel in the source moves with the parameters of the rig.
#pragma once

#include <Eigen/Core>
#include <type_traits>
#include <utility>

#include "geometry/projector.hpp"
#include "xcalib/parameters.hpp"

namespace xcalib {

// Chain rule through Eq. (3d_mapping): the derivative of any f(x_S), given df/du and df/dv, by the
// parameters.
class ProjectionDerivative {
   public:
    explicit ProjectionDerivative(const Rig& rig)
        : R_(rig.R().cast<float>()), reference_(rig.reference),
          fx_(static_cast<float>(rig.source_K()(0, 0))), fy_(static_cast<float>(rig.source.fy)),
          skew_(static_cast<float>(rig.source.skew)), width_(static_cast<float>(rig.source.width)),
          height_(static_cast<float>(rig.source.height)),
          lens_(has_lens_parameters(rig.source.lens) ? 1.0f : 0.0f) {}

    // df/du and df/dv, and from them df/dX_S.
    struct Slope {
        float du, dv, qx, qy, qz;
    };
    // Does either lens bend at the point? Where not, shown_x, shown_y and the slopes of the lenses
    // are not read.
    template <bool kBends>
    Slope slope(const SeenPoint& p, float df_du, float df_dv) const {
        Slope s;
        s.du = df_du;
        s.dv = df_dv;
        if constexpr (kBends) {
            const float x = df_du * fx_, y = df_du * skew_ + df_dv * fy_;  // by what is shown
            s.qx = (x * p.source.xx + y * p.source.xy) * p.inverse_z;
            s.qy = (x * p.source.xy + y * p.source.yy) * p.inverse_z;
        } else {
            s.qx = df_du * fx_ * p.inverse_z;
            s.qy = (df_du * skew_ + df_dv * fy_) * p.inverse_z;
        }
        s.qz = -(s.qx * p.x + s.qy * p.y);
        return s;
    }

    // df by one parameter.
    template <int kParameter, bool kBends>
    float partial(const SeenPoint& p, float depth, const Slope& s) const {
        const float x = kBends ? p.shown_x : p.x, y = kBends ? p.shown_y : p.y;
        if constexpr (kParameter == kSourceLogFx) return s.du * fx_ * x;
        if constexpr (kParameter == kSourceLogFy) return s.dv * fy_ * y;
        if constexpr (kParameter == kSourceCx) return s.du * width_;
        if constexpr (kParameter == kSourceCy) return s.dv * height_;
        if constexpr (kParameter == kSourceSkew) return s.du * width_ * y;
        // q . (w x R X_R) = w . (R X_R x q)
        if constexpr (kParameter == kRotationX) return p.ry * s.qz - p.rz * s.qy;
        if constexpr (kParameter == kRotationY) return p.rz * s.qx - p.rx * s.qz;
        if constexpr (kParameter == kRotationZ) return p.rx * s.qy - p.ry * s.qx;
        if constexpr (kParameter == kTranslationX) return s.qx;
        if constexpr (kParameter == kTranslationY) return s.qy;
        if constexpr (kParameter == kTranslationZ) return s.qz;
        if constexpr (kParameter == kSourceK1 || kParameter == kSourceK2) {
            const float r2 = p.x * p.x + p.y * p.y;
            const float by = lens_ * (kParameter == kSourceK1 ? r2 : r2 * r2);
            return by * (s.du * fx_ * p.x + (s.du * skew_ + s.dv * fy_) * p.y);
        } else if constexpr (kParameter >= kReferenceLogFx) {
            const float fx = static_cast<float>(reference_.fx);
            const float fy = static_cast<float>(reference_.fy);
            const float skew = static_cast<float>(reference_.skew);
            const float w = static_cast<float>(reference_.width);
            const float h = static_cast<float>(reference_.height);
            // df/d(X_R / Z_R), and so df/d ray
            float ex = depth * (R_(0, 0) * s.qx + R_(1, 0) * s.qy + R_(2, 0) * s.qz);
            float ey = depth * (R_(0, 1) * s.qx + R_(1, 1) * s.qy + R_(2, 1) * s.qz);
            if constexpr (kBends) {
                const float straight = ex;
                ex = p.reference.xx * straight + p.reference.xy * ey;
                ey = p.reference.xy * straight + p.reference.yy * ey;
            }
            if constexpr (kParameter == kReferenceLogFx) return -ex * p.ray_x;
            // fx ray_x = u - cx - skew ray_y: ray_y's part does not scale with fx.
            if constexpr (kParameter == kReferenceLogFy) return (ex * skew / fx - ey) * p.ray_y;
            if constexpr (kParameter == kReferenceCx) return -ex * w / fx;
            if constexpr (kParameter == kReferenceCy) return (ex * skew / fx - ey) * h / fy;
            if constexpr (kParameter == kReferenceSkew) return -ex * p.ray_y * w / fx;
        }
    }

    // By the first kCount parameters: writes out[p * stride] for p in 0..kCount-1.
    template <int kCount>
    void chain(const SeenPoint& p, float depth, float df_du, float df_dv, float* out,
               int stride) const {
        const Slope s = slope<true>(p, df_du, df_dv);
        each<kCount>([&](auto parameter) {
            out[parameter * stride] = partial<parameter, true>(p, depth, s);
        });
    }

    // Calls work(std::integral_constant<int, p>) for p in 0..kCount-1.
    template <int kCount, class Work>
    static void each(const Work& work) {
        each(work, std::make_integer_sequence<int, kCount>());
    }

   private:
    template <class Work, int... kParameters>
    static void each(const Work& work, std::integer_sequence<int, kParameters...>) {
        (work(std::integral_constant<int, kParameters>()), ...);
    }

    Eigen::Matrix3f R_;
    Pinhole reference_;
    float fx_, fy_, skew_, width_, height_;
    float lens_;  // 1 where k1 and k2 are parameters, else 0
};

// dT/dp at one reference pixel, (2 x kNumParameters) [px per unit parameter].
Eigen::Matrix<double, 2, kNumParameters> warp_jacobian(const Rig& rig, double x, double y,
                                                       double depth);

}  // namespace xcalib

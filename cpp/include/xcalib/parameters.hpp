// The numbers that a calibration estimates: the paper's parameterization, the solver's, and the
// order of every Jacobian.
#pragma once

#include <Eigen/Core>
#include <array>

#include "xcalib/camera.hpp"
#include "xcalib/export.hpp"

namespace XCALIB_EXPORT xcalib {

// The parameters of a rig in the order of every Jacobian of this library, scaled as
// SolverParameters: source camera, rotation (R <- exp(w) R), translation, reference camera, and the
// source's lens, a brown whose other coefficients stay (a fisheye, or a rational one, stays whole).
// clang-format off
enum Parameter : int {
    kSourceLogFx, kSourceLogFy, kSourceCx, kSourceCy, kSourceSkew,
    kRotationX, kRotationY, kRotationZ,
    kTranslationX, kTranslationY, kTranslationZ,
    kReferenceLogFx, kReferenceLogFy, kReferenceCx, kReferenceCy, kReferenceSkew,
    kSourceK1, kSourceK2,
    kNumParameters
};
// clang-format on
inline constexpr int kNumWithoutReference = kReferenceLogFx;

// Parameters by which something is differentiated, ascending.
class Parameters {
   public:
    explicit Parameters(int count) {  // the first `count` of them
        for (int p = 0; p < count; ++p) add(p);
    }
    void add(int parameter) { index_[size_++] = parameter; }
    int size() const { return size_; }
    int operator[](int i) const { return index_[i]; }

   private:
    int size_ = 0;
    std::array<int, kNumParameters> index_{};
};

// The paper's parameterization: unconstrained numbers that are 1 or 0 or 1/2 at its start.
struct PaperParameters {
    struct Camera {
        double fx = 1.0;    // Eq. (focal_lengths)
        double fy = 1.0;    // Eq. (focal_lengths)
        double cx = 0.5;    // of the width, from the left edge of the first pixel
        double cy = 0.5;    // of the height
        double skew = 0.0;  // [px]
    };
    Camera reference;
    Camera source;
    Eigen::Matrix<double, 4, 1, Eigen::DontAlign> quaternion = {1, 0, 0,
                                                                0};  // w x y z, any norm but 0
    // Eq. (translation): column k in lambda_t^k m. The paper has the first two, and tries all
    // three.
    Eigen::Matrix3d translation = Eigen::Matrix3d::Zero();
    double source_lens[2] = {0, 0};  // k1, k2: not the paper's
};

inline constexpr double kPaperTranslationScale = 10.0;  // lambda_t

// What is no parameter, as the image sizes and the lenses, is that of `rest`.
Rig rig_from_paper(const PaperParameters& parameters, const Rig& rest);
// The translation goes to the finest component whole: the split is not unique.
PaperParameters paper_from_rig(const Rig& rig);

// The solver's parameterization: every number is dimensionless or in metres, of order one, and the
// same at every pyramid level.
struct SolverParameters {
    struct Camera {
        double log_f[2];       // log(fx / width), log(fy / height)
        double center[2];      // (cx + 1/2) / width, (cy + 1/2) / height
        double skew_share[1];  // skew / width
    };
    Camera reference;
    Camera source;
    double quaternion[4];   // w x y z, unit
    double translation[3];  // [m]
    double source_lens[2];  // k1, k2
};

// Are k1 and k2 parameters? Of no lens, or a brown that is a polynomial.
bool has_lens_parameters(const Lens& lens);

SolverParameters solver_from_rig(const Rig& rig);
// What is no parameter, as the image sizes and the lenses, is that of `rest`.
Rig rig_from_solver(const SolverParameters& parameters, const Rig& rest);

}  // namespace xcalib

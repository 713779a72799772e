#include "objective/paper_variables.hpp"

#include <cmath>

namespace xcalib {
namespace {

constexpr double kPi = 3.14159265358979323846;

}  // namespace

PaperVector vector_of(const PaperParameters& p) {
    PaperVector x;
    const auto put = [&x](int first, const PaperParameters::Camera& c) {
        x.segment<5>(first) << c.fx, c.fy, c.cx, c.cy, c.skew;
    };
    put(kPaperReference, p.reference);
    put(kPaperSource, p.source);
    x.segment<4>(kPaperQuaternion) = p.quaternion;
    x.segment<9>(kPaperTranslation) = p.translation.reshaped();
    x.segment<2>(kPaperLens) << p.source_lens[0], p.source_lens[1];
    return x;
}

PaperParameters paper_of(const PaperVector& x) {
    PaperParameters p;
    const auto camera = [&x](int first) {
        return PaperParameters::Camera{x[first], x[first + 1], x[first + 2], x[first + 3],
                                       x[first + 4]};
    };
    p.reference = camera(kPaperReference);
    p.source = camera(kPaperSource);
    p.quaternion = x.segment<4>(kPaperQuaternion);
    p.translation = x.segment<9>(kPaperTranslation).reshaped(3, 3);
    for (int i = 0; i < 2; ++i) p.source_lens[i] = x[kPaperLens + i];
    return p;
}

Eigen::Matrix<double, kNumParameters, kNumPaperVariables> paper_jacobian(const PaperParameters& p,
                                                                         const Rig& sizes) {
    Eigen::Matrix<double, kNumParameters, kNumPaperVariables> jacobian;
    jacobian.setZero();
    const auto camera = [&](int row, int column, const PaperParameters::Camera& c,
                            const Pinhole& size) {
        // log f = const - log tan(x a): the derivative is -2 a / sin(2 x a).
        const double a[2] = {
            kPi / 8, std::atan(static_cast<double>(size.height) / size.width * std::tan(kPi / 8))};
        const double x[2] = {c.fx, c.fy};
        for (int i = 0; i < 2; ++i)
            jacobian(row + i, column + i) = -2 * a[i] / std::sin(2 * x[i] * a[i]);
        jacobian(row + 2, column + 2) = 1;
        jacobian(row + 3, column + 3) = 1;
        jacobian(row + 4, column + 4) = 1.0 / size.width;
    };
    camera(kSourceLogFx, kPaperSource, p.source, sizes.source);
    camera(kReferenceLogFx, kPaperReference, p.reference, sizes.reference);
    // R <- exp(w) R is q <- (1, w/2) q.
    const double norm = p.quaternion.norm();
    const Eigen::Vector4d q = p.quaternion / norm;
    Eigen::Matrix<double, 4, 3> by_w;
    by_w << -q[1], -q[2], -q[3],  //
        q[0], q[3], -q[2],        //
        -q[3], q[0], q[1],        //
        q[2], -q[1], q[0];
    jacobian.block<3, 4>(kRotationX, kPaperQuaternion) = 2 / norm * by_w.transpose();
    for (int scale = 0; scale < 3; ++scale)
        jacobian.block<3, 3>(kTranslationX, kPaperTranslation + 3 * scale) =
            std::pow(kPaperTranslationScale, scale) * Eigen::Matrix3d::Identity();
    jacobian.block<2, 2>(kSourceK1, kPaperLens).setIdentity();
    return jacobian;
}

}  // namespace xcalib

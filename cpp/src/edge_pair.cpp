#include <cmath>

#include "bilinear.hpp"
#include "image_pair.hpp"
#include "nec_pass.hpp"
#include "xcalib/warp.hpp"

namespace xcalib {
namespace {

using Complex = std::complex<float>;

// A source rolled by phi shows every direction turned by it: z by twice that.
Complex unroll(const Rig& rig) {
    const Eigen::Matrix3d R = rig.R();
    const double roll = std::atan2(R(1, 0), R(0, 0));
    return {static_cast<float>(std::cos(2 * roll)), static_cast<float>(-std::sin(2 * roll))};
}

struct Row {
    std::vector<float> u, v;
    std::vector<std::uint8_t> validity;
    explicit Row(int width) : u(width), v(width), validity(width) {}
};

NecValue value_of(double rr, double ss, double rs, double reference_energy) {
    NecValue value;
    value.norm = std::sqrt(rr * ss);
    value.nec = value.aligned = value.norm > 0 ? rs / value.norm : 0.0;
    value.valid_share = reference_energy > 0 ? rr / reference_energy : 0.0;
    return value;
}

}  // namespace

EdgePair::EdgePair(EdgeMap reference, EdgeMap source, Image depth)
    : reference_(std::move(reference)), source_(std::move(source)), depth_(std::move(depth)) {
    for (std::size_t i = 0; i < depth_.pixels.size(); ++i) {
        if (depth_.pixels[i] <= 0) reference_.z[i] = 0;
        reference_energy_ += std::norm(reference_.z[i]);
    }
}

NecValue EdgePair::evaluate(const Rig& rig) const {
    const Reprojection reprojection(rig);
    const Complex turn = unroll(rig);
    Row row(depth_.width);
    double rr = 0, ss = 0, rs = 0;
    for (int y = 0; y < depth_.height; ++y) {
        map_row(reprojection, depth_.row(y), y, depth_.width, row.u.data(), row.v.data(),
                row.validity.data());
        const Complex* reference = reference_.row(y);
        for (int x = 0; x < depth_.width; ++x) {
            if (row.validity[x]) continue;
            const Complex r = reference[x];
            const Complex s = product(bilinear(source_, row.u[x], row.v[x]).value, turn);
            rr += std::norm(r);
            ss += std::norm(s);
            rs += r.real() * s.real() + r.imag() * s.imag();
        }
    }
    return value_of(rr, ss, rs, reference_energy_);
}

template <int kCount>
NecNormalEquations EdgePair::normal_equations_of(const Rig& rig) const {
    const Reprojection reprojection(rig);
    const ProjectionDerivative derivative(rig);
    const Complex turn = unroll(rig);
    const Pinhole& camera = rig.reference;
    Row row(depth_.width);
    // [dZ_S/dp, Z_S, Z_R] of a row's pixels, real and imaginary parts in turn.
    Eigen::Matrix<double, kCount + 2, Eigen::Dynamic> columns(kCount + 2, 2 * depth_.width);
    Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(kCount + 2, kCount + 2);
    for (int y = 0; y < depth_.height; ++y) {
        map_row(reprojection, depth_.row(y), y, depth_.width, row.u.data(), row.v.data(),
                row.validity.data());
        const double ray_y = (y - camera.cy) / camera.fy;
        int filled = 0;
        for (int x = 0; x < depth_.width; ++x) {
            if (row.validity[x]) continue;
            Sample<Complex> s = bilinear(source_, row.u[x], row.v[x]);
            s = {product(s.value, turn), product(s.du, turn), product(s.dv, turn)};
            const auto ray_x =
                static_cast<float>((x - camera.cx - camera.skew * ray_y) / camera.fx);
            float real[kCount], imaginary[kCount];
            const float depth = depth_.row(y)[x];
            derivative.chain<kCount>(ray_x, static_cast<float>(ray_y), depth, s.du.real(),
                                     s.dv.real(), real, 1);
            derivative.chain<kCount>(ray_x, static_cast<float>(ray_y), depth, s.du.imag(),
                                     s.dv.imag(), imaginary, 1);
            real[kRotationZ] += 2 * s.value.imag();  // of exp(-2 i phi)
            imaginary[kRotationZ] -= 2 * s.value.real();
            for (int p = 0; p < kCount; ++p) {
                columns(p, filled) = real[p];
                columns(p, filled + 1) = imaginary[p];
            }
            columns(kCount, filled) = s.value.real();
            columns(kCount, filled + 1) = s.value.imag();
            columns(kCount + 1, filled) = reference_.row(y)[x].real();
            columns(kCount + 1, filled + 1) = reference_.row(y)[x].imag();
            filled += 2;
        }
        gram.selfadjointView<Eigen::Lower>().rankUpdate(columns.leftCols(filled));
    }
    gram = gram.selfadjointView<Eigen::Lower>();
    return equations_from_gram(gram, value_of(gram(kCount + 1, kCount + 1), gram(kCount, kCount),
                                              gram(kCount + 1, kCount), reference_energy_));
}

NecNormalEquations EdgePair::normal_equations(const Rig& rig, int count) const {
    return count <= kNumWithoutReference ? normal_equations_of<kNumWithoutReference>(rig)
                                         : normal_equations_of<kNumParameters>(rig);
}

}  // namespace xcalib

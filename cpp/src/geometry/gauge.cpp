#include "geometry/gauge.hpp"

#include <Eigen/LU>
#include <utility>

namespace xcalib {
namespace {

// K R with K upper triangular and its diagonal positive, R a rotation.
std::pair<Eigen::Matrix3d, Eigen::Matrix3d> split(const Eigen::Matrix3d& matrix) {
    Eigen::Matrix3d K = Eigen::Matrix3d::Zero(), R;
    for (int i = 2; i >= 0; --i) {
        Eigen::RowVector3d row = matrix.row(i);
        for (int k = 2; k > i; --k) {
            K(i, k) = row.dot(R.row(k));
            row -= K(i, k) * R.row(k);
        }
        K(i, i) = row.norm();
        R.row(i) = row / K(i, i);
    }
    return {K, R};
}

}  // namespace

Rig with_other_reference(const Rig& rig, double focal, double dx, double dy) {
    Rig out = rig;
    out.reference.fx *= focal;
    out.reference.fy *= focal;
    out.reference.cx += dx;
    out.reference.cy += dy;
    // K_S R K_R^-1 stays, and so does K_S t, at the scale that depth has.
    auto [K, R] = split(infinite_homography(rig) * out.reference.K());
    const double scale = K(2, 2);
    K /= scale;
    out.source = Pinhole::from_K(rig.source.width, rig.source.height, K);
    out.source_from_reference.rotation = R;
    out.source_from_reference.translation = K.inverse() * rig.source.K() * rig.t() / scale;
    return out;
}

}  // namespace xcalib

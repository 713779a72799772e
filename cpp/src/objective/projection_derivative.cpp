#include "objective/projection_derivative.hpp"

namespace xcalib {

Eigen::Matrix<double, 2, kNumParameters> warp_jacobian(const Rig& rig, double x, double y,
                                                       double depth) {
    const Eigen::Vector3d ray = unproject(rig.reference, x, y, 1.0);
    const ProjectionDerivative derivative(rig);
    Eigen::Matrix<double, 2, kNumParameters> jacobian;
    float column[kNumParameters];
    for (int i = 0; i < 2; ++i) {
        derivative.chain<kNumParameters>(static_cast<float>(ray.x()), static_cast<float>(ray.y()),
                                         static_cast<float>(depth), i == 0, i == 1, column, 1);
        for (int p = 0; p < kNumParameters; ++p) jacobian(i, p) = column[p];
    }
    return jacobian;
}

}  // namespace xcalib

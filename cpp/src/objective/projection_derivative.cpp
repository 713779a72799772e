#include "objective/projection_derivative.hpp"

namespace xcalib {

Eigen::Matrix<double, 2, kNumParameters> warp_jacobian(const Rig& rig, double x, double y,
                                                       double depth) {
    const SeenPoint point = seen_point(rig, x, y, depth);
    const ProjectionDerivative derivative(rig);
    Eigen::Matrix<double, 2, kNumParameters> jacobian;
    float column[kNumParameters];
    for (int i = 0; i < 2; ++i) {
        derivative.chain<kNumParameters>(point, static_cast<float>(depth), i == 0, i == 1, column,
                                         1);
        for (int p = 0; p < kNumParameters; ++p) jacobian(i, p) = column[p];
    }
    return jacobian;
}

}  // namespace xcalib

#include <gtest/gtest.h>

#include <vector>

#include "objective/projection_derivative.hpp"
#include "scenes.hpp"

namespace xcalib {
namespace {

using namespace ::xcalib::testing;  // NOLINT: scenes.hpp

void expect_jacobian_of_central_differences(const Rig& rig, std::mt19937& random) {
    const double x = uniform(random, 20, 620), y = uniform(random, 20, 460);
    const double depth = uniform(random, 1, 20);
    const auto jacobian = warp_jacobian(rig, x, y, depth);
    Eigen::Matrix<double, 2, kNumParameters> numeric;
    constexpr double kStep = 1e-5;
    for (int p = 0; p < kNumParameters; ++p)
        numeric.col(p) = (transfer(moved(rig, p, kStep), x, y, depth) -
                          transfer(moved(rig, p, -kStep), x, y, depth)) /
                         (2 * kStep);
    for (const ParameterClass& group : kParameterClasses) {
        const auto expected = numeric.middleCols(group.first, group.count);
        const auto found = jacobian.middleCols(group.first, group.count);
        if (group.first == kSourceK1 && !has_lens_parameters(rig.source.lens)) {
            EXPECT_EQ(found.norm(), 0) << "k1 and k2 of another lens are no parameters";
            continue;
        }
        EXPECT_GT(expected.norm(), 0) << group.name;
        EXPECT_LT((found - expected).norm(), 1e-4 * expected.norm()) << group.name;
    }
}

TEST(WarpJacobian, AgreesWithCentralDifferencesPerParameterClass) {
    std::mt19937 random(3);
    for (int i = 0; i < 30; ++i)
        expect_jacobian_of_central_differences(random_rig(random, 640, 480, 320, 256), random);
}

TEST(WarpJacobian, AgreesWithCentralDifferencesWhereLensesBendAndImagesAreMirrored) {
    std::mt19937 random(5);
    for (int i = 0; i < 90; ++i)
        expect_jacobian_of_central_differences(random_bent_rig(random, i, 640, 480, 320, 256),
                                               random);
}

TEST(ProjectionDerivative, IsTheChainRuleAndTheSameWithoutTheReference) {
    std::mt19937 random(4);
    const Rig rig = random_rig(random, 640, 480, 320, 256);
    const auto jacobian = warp_jacobian(rig, 333, 222, 4.5);
    const SeenPoint point = seen_point(rig, 333, 222, 4.5);
    const ProjectionDerivative derivative(rig);
    constexpr int kStride = 3;
    std::vector<float> all(kStride * kNumParameters, -1.0f);
    std::vector<float> some(kStride * kNumParameters, -1.0f);
    derivative.chain<kNumParameters>(point, 4.5f, 0.7f, -1.3f, all.data(), kStride);
    derivative.chain<kNumWithoutReference>(point, 4.5f, 0.7f, -1.3f, some.data(), kStride);
    for (int p = 0; p < kNumParameters; ++p) {
        const double expected = 0.7 * jacobian(0, p) - 1.3 * jacobian(1, p);
        EXPECT_NEAR(all[p * kStride], expected, 1e-5 * jacobian.col(p).norm()) << p;
        EXPECT_EQ(all[p * kStride + 1], -1) << "wrote between its strides";
        EXPECT_EQ(some[p * kStride], p < kNumWithoutReference ? all[p * kStride] : -1) << p;
    }
}

}  // namespace
}  // namespace xcalib

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "objective/image_pair.hpp"
#include "scenes.hpp"
#include "xcalib/edge_map.hpp"

namespace xcalib {
namespace {

using namespace ::xcalib::testing;  // NOLINT: scenes.hpp

// A bright bar through the middle whose edges run along `degrees`.
Image bar(double degrees, int size, double width) {
    const double angle = degrees * 3.14159265358979323846 / 180, middle = 0.5 * (size - 1);
    return drawn(
        [=](double x, double y) {
            const double across = (y - middle) * std::cos(angle) - (x - middle) * std::sin(angle);
            return 0.5 + 0.5 * std::tanh((0.5 * width - std::abs(across)) / 0.7);
        },
        size, size);
}

std::complex<double> sum_of(const EdgeMap& map) {
    std::complex<double> sum = 0;
    for (const auto& z : map.z) sum += std::complex<double>(z);
    return sum;
}

TEST(EdgeMap, HoldsTwiceTheAngleOfTheGradient) {
    for (const double degrees : {0.0, 25.0, 70.0, 90.0, 135.0}) {
        // The gradient is at right angles to the bar, and its double the opposite of the bar's.
        const double found = std::arg(sum_of(edge_map(bar(degrees, 101, 9))));
        const double expected = 2 * (degrees + 90) * 3.14159265358979323846 / 180;
        EXPECT_NEAR(std::remainder(found - expected, 2 * 3.14159265358979323846), 0, 0.1)
            << degrees;
    }
}

TEST(EdgeMap, DoesNotKnowBrightFromDark) {
    const Image image = bar(30, 64, 7);
    Image reversed = image;
    for (float& value : reversed.pixels) value = 1 - value;
    const EdgeMap one = edge_map(image), other = edge_map(reversed);
    for (std::size_t i = 0; i < one.z.size(); ++i) EXPECT_LT(std::abs(one.z[i] - other.z[i]), 1e-4);
}

TEST(EdgeMap, IsHalvedUntilItIsSmallEnough) {
    EXPECT_EQ(edge_map(Image(400, 300, 0.5f)).width, 400);
    EXPECT_EQ(edge_map(Image(401, 300, 0.5f)).width, 200);
    EXPECT_EQ(edge_map(Image(1280, 960, 0.5f)).height, 240);
}

// What a blurred image would lose: a bar thinner than a pixel of the reduced map.
TEST(EdgeMap, ThinBarsSurviveReduction) {
    const EdgeMap small = reduced(edge_map(bar(0, 160, 3)), 20, 20);
    EXPECT_EQ(small.width, 20);
    double on = 0, off = 0;
    for (int x = 2; x < 18; ++x) {
        on += std::abs(small.row(10)[x]);
        off += std::abs(small.row(4)[x]);
    }
    EXPECT_GT(on, 20 * off);
}

TEST(EdgeMap, ReductionTakesOutWhatARegionHasInCommon) {
    EdgeMap even{40, 40, std::vector<std::complex<float>>(1600, {0.3f, -0.2f})};
    for (const auto& z : reduced(even, 20, 20).z) EXPECT_LT(std::abs(z), 1e-6);
    EXPECT_EQ(reduced(even, 80, 80).width, 40) << "a side that would grow is left";
}

struct EdgeScene {
    Rig truth;
    EdgePair pair;
};

EdgeScene edge_scene(unsigned seed, const Eigen::Vector3d& turn = {0, 0, 0}) {
    constexpr int kWidth = 120, kHeight = 90;
    std::mt19937 random(seed);
    Rig truth = turned(random_rig(random, kWidth, kHeight, kWidth, kHeight), turn);
    const Field texture = blobs(random, kWidth, kHeight, 30, 5, 0.5);
    const Field depth = rolling_depth(kWidth, kHeight);
    const Image reference = drawn(texture, kWidth, kHeight);
    EdgePair pair(reduced(edge_map(reference), kWidth, kHeight),
                  reduced(edge_map(source_view(truth, texture, depth)), kWidth, kHeight),
                  drawn(depth, kWidth, kHeight));
    return {truth, std::move(pair)};
}

TEST(EdgePair, AgreesMostAtTheTruthWhateverTheRoll) {
    for (const double roll : {0.0, 0.4, 1.2}) {
        const EdgeScene scene = edge_scene(3, {0, 0, roll});
        const double here = scene.pair.evaluate(scene.truth).nec;
        EXPECT_GT(here, 0.8) << roll;
        for (const Eigen::Vector3d& w :
             {Eigen::Vector3d(0.03, 0, 0), Eigen::Vector3d(0, 0.03, 0), Eigen::Vector3d(0, 0, 0.1)})
            EXPECT_LT(scene.pair.evaluate(turned(scene.truth, w)).nec, here - 0.1) << roll;
    }
}

TEST(EdgePair, GradientIsThatOfTheValue) {
    for (unsigned seed = 1; seed <= 3; ++seed) {
        const EdgeScene scene = edge_scene(seed);
        const Rig rig = turned(scene.truth, {0.004, -0.006, 0.01});
        const Eigen::VectorXd found =
            scene.pair.normal_equations(rig, Parameters(kNumParameters)).gradient;
        for (int p = 0; p < kNumParameters; ++p) {
            // Averaged over the step, as in test_nec.cpp: interpolation has kinks.
            const double step = 0.7 / farthest_move(rig, p);
            double analytic = 0;
            constexpr int kSamples = 200;
            for (int i = 0; i < kSamples; ++i)
                analytic +=
                    scene.pair
                        .normal_equations(moved(rig, p, step * ((2 * i + 1.0) / kSamples - 1)),
                                          Parameters(kNumParameters))
                        .gradient[p] /
                    kSamples;
            const double numeric = (scene.pair.evaluate(moved(rig, p, -step)).nec -
                                    scene.pair.evaluate(moved(rig, p, step)).nec) /
                                   (2 * step);
            EXPECT_NEAR(analytic, numeric, 0.02 * std::abs(numeric) + 1e-3 * found.norm())
                << "parameter " << p << ", seed " << seed;
        }
    }
}

TEST(EdgePair, ValueOfTheNormalEquationsIsTheValue) {
    const EdgeScene scene = edge_scene(5);
    const Rig rig = turned(scene.truth, {0.01, 0.02, -0.01});
    const NecValue cheap = scene.pair.evaluate(rig);
    const NecNormalEquations full =
        scene.pair.normal_equations(rig, Parameters(kNumWithoutReference));
    EXPECT_NEAR(full.value.nec, cheap.nec, 1e-6);
    EXPECT_NEAR(full.value.norm, cheap.norm, 1e-6 * cheap.norm);
    EXPECT_NEAR(full.value.valid_share, cheap.valid_share, 1e-6);
    EXPECT_EQ(full.hessian.rows(), kNumWithoutReference);
    EXPECT_EQ(full.hessian, full.hessian.transpose());
}

}  // namespace
}  // namespace xcalib

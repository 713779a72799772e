#include <gtest/gtest.h>

#include <cmath>

#include "calibrate/relative_depth.hpp"
#include "working_scene.hpp"

namespace xcalib {
namespace {

using namespace ::xcalib::testing;  // NOLINT: working_scene.hpp

TEST(RelativeDepth, AShiftOfInverseDepthIsAGauge) {
    std::mt19937 random(1);
    for (const double shift : {-0.02, 0.005, 0.1, 0.3}) {
        const Rig rig = random_rig(random, kWidth, kHeight, 180, 144);
        const Rig other = with_shifted_depth(rig, shift);
        other.validate();
        EXPECT_EQ(other.source.width, 180);
        EXPECT_GT((other.source.K() - rig.source.K()).norm(), 0.01);
        for (int i = 0; i < 50; ++i) {
            const double x = uniform(random, 0, kWidth), y = uniform(random, 0, kHeight);
            const double inverse = uniform(random, 0.025, 0.5);
            EXPECT_LT((mapped(other, x, y, 1 / (inverse + shift)) - mapped(rig, x, y, 1 / inverse))
                          .norm(),
                      1e-8);
        }
    }
}

TEST(RelativeDepth, ShiftsUndoEachOther) {
    std::mt19937 random(2);
    const Rig rig = random_rig(random, kWidth, kHeight, 180, 144);
    const Rig back = with_shifted_depth(with_shifted_depth(rig, 0.07), -0.07);
    EXPECT_LT((back.source.K() - rig.source.K()).norm(), 1e-8);
    EXPECT_LT((back.R() - rig.R()).norm(), 1e-10);
    EXPECT_LT((back.t() - rig.t()).norm(), 1e-10);
}

TEST(RelativeDepth, DepthOfTheImagesIsShifted) {
    const Scene scene = make_scene(1);
    const WorkingImages shifted = with_shifted_depth(scene.images, 0.05);
    for (const int factor : kFactors) {
        const Image& before = scene.images.pyramid.at(factor).depths[1];
        const Image& after = shifted.pyramid.at(factor).depths[1];
        for (std::size_t i = 0; i < before.pixels.size(); ++i)
            EXPECT_NEAR(1 / after.pixels[i], 1 / before.pixels[i] + 0.05, 1e-6);
    }
    // Beyond infinity is as far as can be, and unknown stays unknown.
    WorkingImages images = scene.images;
    images.pyramid.at(1).depths[0].pixels[0] = 0;
    const Image far = with_shifted_depth(images, -1.0).pyramid.at(1).depths[0];
    EXPECT_EQ(far.pixels[0], 0);
    EXPECT_NEAR(far.pixels[1], 1e4, 1);
}

TEST(RelativeDepth, TheOrdinaryCameraIsFound) {
    std::mt19937 random(3);
    Rig ordinary = random_rig(random, kWidth, kHeight, 180, 144);
    ordinary.source = Pinhole::from_hfov(180, 144, 0.8);
    ordinary.source_from_reference.translation = {1.5, 0.9, 0.1};
    for (const double shift : {-0.005, 0.02, 0.05}) {
        const double found = ordinary_shift(with_shifted_depth(ordinary, shift), 0.05);
        EXPECT_NEAR(found, -shift, 0.1 * std::abs(shift)) << shift;
    }
}

TEST(RelativeDepth, TheImagesTellTheShiftIfTheSourceIsKnown) {
    Scene scene = make_scene(1);
    CalibrationOptions options;
    options.num_threads = 2;
    options.source_camera = scene.truth.source;
    const WorkingImages wrong = with_shifted_depth(scene.images, 0.04);
    Rig rig = turned(scene.truth, {0.002, -0.003, 0.001});
    const double shift = best_shift(wrong, Plan(options), farthest_inverse_depth(wrong), rig);
    EXPECT_NEAR(shift, -0.04, 0.01);
    EXPECT_EQ(rig.source.fx, scene.truth.source.fx);
    EXPECT_LT(end_point_error(scene, rig), 0.1);
}

TEST(RelativeDepth, TheFarthestInverseDepthLeavesOutTheLastPercents) {
    Scene scene = make_scene(1);
    const double before = farthest_inverse_depth(scene.images);
    EXPECT_GT(before, 0.03);
    EXPECT_LT(before, 0.2);
    scene.images.pyramid.at(kCoarse).depths[0].pixels[0] = 1e6f;
    EXPECT_NEAR(farthest_inverse_depth(scene.images), before, 0.01);
}

}  // namespace
}  // namespace xcalib

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "calibrate/verdict.hpp"
#include "calibrate/visible_shift.hpp"
#include "working_scene.hpp"

namespace xcalib {
namespace {

using namespace ::xcalib::testing;  // NOLINT: working_scene.hpp

TEST(VisibleShift, IsHowFarTheRigIsOff) {
    for (const unsigned seed : {1u, 2u, 3u}) {
        SCOPED_TRACE(seed);
        const Scene scene = make_scene(seed, 300, 2);
        EXPECT_LT(visible_shift(scene.images, scene.truth, 2), 0.5);
        for (const double turn : {0.01, 0.03}) {
            Rig rig = turned(scene.truth, {0.7 * turn, -turn, 0.0});
            rig.source.fx *= 1 + turn;
            rig.source.fy *= 1 + turn;
            const double off = end_point_error(scene, rig) * rig.reference.fx / rig.source.fx;
            EXPECT_NEAR(visible_shift(scene.images, rig, 2), off, 0.25 * off) << turn;
        }
    }
}

TEST(VisibleShift, DoesNotDependOnThreads) {
    const Scene scene = make_scene(4, 300, 2);
    const Rig rig = perturbed(scene.truth);
    EXPECT_EQ(visible_shift(scene.images, rig, 1), visible_shift(scene.images, rig, 3));
}

TEST(VisibleShift, IsUnknownWhereNothingCanBeSeen) {
    Scene scene = make_scene(5, 300, 2);
    for (Image& source : scene.images.sources)
        std::fill(source.pixels.begin(), source.pixels.end(), 0.5f);
    EXPECT_TRUE(std::isnan(visible_shift(scene.images, scene.truth, 2)));
}

// Where the other checks are content: wide edges still meet, and both halves of the frames lead
// back to the same place.
TEST(Verdict, AFitThatFlowSeesToBeOffIsNotTrusted) {
    const Scene scene = make_scene(6, 150, 4);
    CalibrationReport report;
    report.valid_share = 0.9;
    const Plan plan{CalibrationOptions{}};
    const auto halves = [](const Rig& rig) {
        Halves same;
        same.rigs = {rig, rig};
        same.independent = true;
        return same;
    };
    judge(scene.images, finest(scene), scene.truth, halves(scene.truth), plan, report);
    EXPECT_TRUE(report.converged) << report.message;
    const Rig off = turned(scene.truth, {0.012, -0.012, 0.0});
    judge(scene.images, finest(scene), off, halves(off), plan, report);
    EXPECT_FALSE(report.converged);
    EXPECT_GT(report.visible_shift_px, 3);
    EXPECT_NE(report.message.find("still sees a shift of"), std::string::npos) << report.message;
}

// One plane in front of another.
TEST(DepthEdges, AreLeftOutOfTheNecAtTheFinerLevelsAndKeptForFlow) {
    Scene scene = make_scene(7);
    for (auto& [factor, level] : scene.images.pyramid)
        for (Image& depth : level.depths)
            for (int y = 0; y < depth.height; ++y)
                for (int x = 0; x < depth.width; ++x)
                    depth.row(y)[x] = x < depth.width / 2 ? 4.0f : 8.0f;
    for (const int factor : kFactors) {
        const Level level = make_level(scene.images, factor, scene.truth, 1);
        const Image& depth = level.pairs[0]->depth();
        const int edge = depth.width / 2, row = depth.height / 2;
        for (const int x : {edge - 1, edge})
            EXPECT_EQ(depth.row(row)[x] > 0, factor >= kCoarse) << factor;
        for (const int x : {edge - 3, edge + 2}) EXPECT_GT(depth.row(row)[x], 0) << factor;
        EXPECT_GT(scene.images.pyramid.at(factor).depths[0].row(row)[edge], 0);
    }
    scene.images.parts.depth_edges = false;
    const Level level = make_level(scene.images, 1, scene.truth, 1);
    const Image& whole = level.pairs[0]->depth();
    EXPECT_GT(whole.row(whole.height / 2)[whole.width / 2], 0);
}

}  // namespace
}  // namespace xcalib

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "base/median.hpp"
#include "calibrate/depth_check.hpp"
#include "calibrate/error_model.hpp"
#include "calibrate/halves.hpp"
#include "calibrate/plausible.hpp"
#include "calibrate/static_edges.hpp"
#include "calibrate/verdict.hpp"
#include "views.hpp"
#include "working_scene.hpp"
#include "xcalib/verdict.hpp"

namespace xcalib {
namespace {

using namespace ::xcalib::testing;  // NOLINT: working_scene.hpp

TEST(Halves, HaveEachFrameOnceAndNeighboursTogether) {
    EXPECT_EQ(halves_of(8)[0], (std::vector<std::size_t>{0, 1, 4, 5}));
    EXPECT_EQ(halves_of(8)[1], (std::vector<std::size_t>{2, 3, 6, 7}));
    for (std::size_t count = 2; count < 40; ++count) {
        const auto halves = halves_of(count);
        EXPECT_EQ(halves[0].size() + halves[1].size(), count);
        EXPECT_FALSE(halves[1].empty()) << count;
        EXPECT_LE(halves[0].size(), halves[1].size() + (count + 3) / 4 + 1) << count;
    }
}

TEST(ExpectedError, OfOneDeviationIsTheQuantileOfItsDistribution) {
    const ExpectedError one = expected_error({1, 1, 1}), two = expected_error({2, 2});
    EXPECT_NEAR(two.median, 2 * one.median, 1e-6);
    EXPECT_NEAR(two.p95, 2 * one.p95, 1e-6);
    // Of a Gaussian in the plane they are 1.18 and 2.45; the tails are heavier.
    EXPECT_NEAR(one.median, 1.25, 0.1);
    EXPECT_GT(one.p95, 2.45);
    EXPECT_EQ(expected_error({}).median, kInfinity);
    EXPECT_EQ(expected_error({1, kInfinity}).p95, kInfinity);
}

Halves both(const Rig& one, const Rig& other) {
    Halves halves;
    halves.rigs = {one, other};
    halves.independent = true;
    return halves;
}

TEST(ErrorModel, GrowsWithWhatTheHalvesDisagreeOnAtTheDepthsAtWhichTheyDo) {
    const Scene scene = make_scene(2, 150, 4);
    const Plan plan{CalibrationOptions{}};
    Rig moved = scene.truth;
    moved.source_from_reference.translation.x() += 0.05;  // nothing that is far moves
    const ErrorModel same(scene.images, finest(scene), scene.truth, both(scene.truth, scene.truth),
                          plan);
    const ErrorModel apart(scene.images, finest(scene), scene.truth, both(scene.truth, moved),
                           plan);
    EXPECT_NEAR(apart.field().at(0).median, same.field().at(0).median, 1e-3);
    EXPECT_GT(apart.field().at(0.5).median, 2 * same.field().at(0.5).median);
    EXPECT_GT(apart.over_footage().median, same.over_footage().median);
    EXPECT_GT(same.over_footage().p95, same.over_footage().median);
    Halves none;
    EXPECT_EQ(
        ErrorModel(scene.images, finest(scene), scene.truth, none, plan).over_footage().median,
        kInfinity);
}

TEST(Plausible, NamesWhatNobodyWouldBuild) {
    const Scene scene = make_scene(3, 150, 4);
    const Plan plan{CalibrationOptions{}};
    const ErrorModel model(scene.images, finest(scene), scene.truth, both(scene.truth, scene.truth),
                           plan);
    EXPECT_FALSE(implausible_in(scene.truth, 4, plan, model.field()));
    const struct {
        void (*spoil)(Rig&);
        const char *reason, *advice;
    } cases[] = {
        {[](Rig& rig) { rig.source.skew = 0.15 * rig.source.fx; }, "skewed by 15.0",
         "shutter roll"},
        {[](Rig& rig) { rig.source.fy *= 1.3; }, "fy is 1", "stretched"},
        {[](Rig& rig) { rig.source.cx += 0.6 * rig.source.width; }, "principal point", "cropped"},
        {[](Rig& rig) { rig.source_from_reference.translation.z() = -1.2; }, "before the reference",
         "--time-offset"},
        {[](Rig& rig) { rig.source_from_reference.translation.z() = 1.2; }, "behind the reference",
         "--time-offset"},
        {[](Rig& rig) { rig.source_from_reference.translation.y() = 9; }, "m apart before things",
         "--depth-scale"},
    };
    for (const auto& each : cases) {
        SCOPED_TRACE(each.reason);
        Rig rig = scene.truth;
        each.spoil(rig);
        const auto found = implausible_in(rig, 4, plan, model.field());
        ASSERT_TRUE(found);
        EXPECT_NE(found->reason.find(each.reason), std::string::npos) << found->reason;
        EXPECT_NE(found->advice.find(each.advice), std::string::npos) << found->advice;
    }
}

// Where the optical axes lie far apart, a wrong focal length of the reference bends the source's
// pixels: the map is the same, and nothing else tells.
TEST(Plausible, ForgivesWhatAnotherReferenceWouldMakeOfTheSameMap) {
    const Scene scene = make_scene(3, 150, 4);
    const ErrorModel model(scene.images, finest(scene), scene.truth, both(scene.truth, scene.truth),
                           Plan{CalibrationOptions{}});
    Rig apart = turned(scene.truth, {0.3, -0.3, 0.0}), beside = scene.truth;
    apart.source.skew = beside.source.skew = 0.05 * apart.source.fx;
    CalibrationOptions known;
    known.reference_camera = scene.truth.reference;
    const auto skewed = [&](const Rig& rig, const CalibrationOptions& options) {
        return implausible_in(rig, 4, Plan(options), model.field()).has_value();
    };
    EXPECT_FALSE(skewed(apart, {}));
    EXPECT_TRUE(skewed(apart, known));
    EXPECT_TRUE(skewed(beside, {}));
}

TEST(DepthCheck, SeesDepthThatBelongsToAnotherFrameOrToNone) {
    const Plan plan{CalibrationOptions{}};
    Scene scene = make_scene(6, 150, 4);
    scene.truth.source_from_reference.translation.x() = 0.4;
    const auto checked = [&] {
        std::vector<float> depths;
        for (const Image& depth : scene.images.pyramid.at(8).depths)
            depths.insert(depths.end(), depth.pixels.begin(), depth.pixels.end());
        return check_depth(scene.images, scene.truth,
                           {quantile(depths, 0.05), quantile(depths, 0.5), quantile(depths, 0.95)},
                           plan);
    };
    const auto change = [&](const auto& work) {
        for (auto& [factor, level] : scene.images.pyramid) work(level.depths);
    };
    EXPECT_TRUE(checked().exchangeable);
    EXPECT_GT(checked().relief, 0.1);
    EXPECT_GT(checked().parallax_px, 1.5);
    change([](std::vector<Image>& depths) {
        for (int y = 0; y < depths[0].height; ++y)
            for (int x = 0; x < depths[0].width; ++x)  // things before a wall
                if (x / 8 % 2 == y / 8 % 2) depths[0].row(y)[x] *= 0.7f;
        for (Image& depth : depths) depth = depths[0];
    });
    EXPECT_FALSE(checked().exchangeable);
    EXPECT_TRUE(checked().one_for_all);
    change([](std::vector<Image>& depths) {
        for (Image& depth : depths)
            for (int y = 0; y < depth.height; ++y)  // a road, and the sky above it
                for (int x = 0; x < depth.width; ++x)
                    depth.row(y)[x] = 2.0f / std::max(0.05f, 2.0f * y / depth.height - 0.9f);
    });
    EXPECT_FALSE(checked().one_for_all);
    change([](std::vector<Image>& depths) {
        for (Image& depth : depths) std::fill(depth.pixels.begin(), depth.pixels.end(), 5.0f);
    });
    EXPECT_EQ(checked().relief, 0);
}

TEST(DepthCheck, NamesWhatIsWrong) {
    DepthCheck right;
    right.own = right.refitted = 0.5;
    right.exchanged = right.beside = {0.4, -0.2, 0.02};
    right.none = right.inverse = {0.3, -0.4, 0.02};
    right.exchangeable = true;
    right.parallax_px = 10;
    right.relief = 1;
    EXPECT_FALSE(wrong_depth(right));
    const struct {
        void (*spoil)(DepthCheck&);
        const char* reason;
    } cases[] = {
        {[](DepthCheck& check) { check.relief = 0; }, "every depth is the same"},
        {[](DepthCheck& check) { check.one_for_all = true; }, "all frames have the same depth"},
        {[](DepthCheck& check) {
             check.inverse = {0.6, 0.2, 0.02};
         },
         "inverse depth fits better"},
        {[](DepthCheck& check) {
             check.mirrored = {0.6, 0.2, 0.02};
         },
         "when they are mirrored"},
        {[](DepthCheck& check) {
             check.upside_down = {0.6, 0.2, 0.02};
         },
         "when they are turned upside down"},
        {[](DepthCheck& check) {
             check.none = {0.6, 0.2, 0.02};
         },
         "no depth at all fits better"},
        {[](DepthCheck& check) {
             check.exchanged = {0.5, 0, 0.02};
         },
         "fits as well as each frame's own"},
        {[](DepthCheck& check) {
             check.beside = {0.6, 0.2, 0.02};
         },
         "the depth of the last frame fits better"},
    };
    for (const auto& each : cases) {
        DepthCheck check = right;
        each.spoil(check);
        const auto found = wrong_depth(check);
        ASSERT_TRUE(found) << each.reason;
        EXPECT_NE(found->reason.find(each.reason), std::string::npos) << found->reason;
    }
    // Too little parallax for depth to matter, or one depth for all: nothing is said of it.
    DepthCheck far = right, same = right;
    far.exchanged = same.exchanged = {0.5, 0, 0.02};
    far.parallax_px = 0.5;
    same.exchangeable = false;
    EXPECT_FALSE(wrong_depth(far));
    EXPECT_FALSE(wrong_depth(same));
    // Two frames, and a gain as large as their scatter.
    DepthCheck chance = right;
    chance.inverse = {0.6, 0.2, 0.15};
    EXPECT_FALSE(wrong_depth(chance));
    // A plane is a guess: that another one fits better is no mistake in the files.
    DepthCheck plane = right;
    plane.is_plane = true;
    plane.inverse = plane.none = plane.upside_down = {0.6, 0.2, 0.02};
    EXPECT_FALSE(wrong_depth(plane));
}

// A cross burnt into otherwise different images.
TEST(StaticEdges, WhatStandsStillHasNoDepthAnyMore) {
    Scene scene = make_scene(7, 150, 4);
    WorkingImages& images = scene.images;
    double share = 0;
    EXPECT_EQ(without_static_edges(images, share).size(), 3u);
    EXPECT_EQ(share, 0);  // three frames do not show it
    const WorkingImages other = make_scene(8, 150, 4).images;
    for (std::size_t i = 0; i < 3; ++i) {
        images.references.push_back(other.references[i]);
        images.sources.push_back(other.sources[i]);
        images.reference_edges.push_back(other.reference_edges[i]);
        images.source_edges.push_back(other.source_edges[i]);
        for (auto& [factor, level] : images.pyramid) {
            const ReducedImages& more = other.pyramid.at(factor);
            level.references.push_back(more.references[i]);
            level.depths.push_back(more.depths[i]);
            if (factor >= kCoarse) level.edges.push_back(more.edges[i]);
        }
    }
    without_static_edges(images, share);
    EXPECT_LT(share, 0.002);
    for (std::size_t i = 0; i < images.size(); ++i) {
        for (int k = 0; k < 24; ++k)
            for (int w = 0; w < 3; ++w) {
                images.references[i].row(40 + w)[60 + k] = 1.5f;
                images.references[i].row(30 + k)[70 + w] = 1.5f;
            }
        images.reference_edges[i] = edge_map(images.references[i]);
    }
    const WorkingImages masked = without_static_edges(images, share);
    EXPECT_GT(share, 0.005);
    EXPECT_EQ(masked.pyramid.at(1).depths[2].row(41)[65], 0);
    EXPECT_EQ(masked.pyramid.at(2).depths[2].row(20)[33], 0);
    EXPECT_GT(masked.pyramid.at(1).depths[2].row(100)[120], 0);
    EXPECT_GT(images.pyramid.at(1).depths[2].row(41)[65], 0);
}

TEST(Verdict, HalvesThatDisagreeHaveFoundNothing) {
    const Scene scene = make_scene(4, 150, 4);
    const Plan plan{CalibrationOptions{}};
    CalibrationReport report;
    report.valid_share = 0.9;
    judge(scene.images, finest(scene), scene.truth, both(scene.truth, scene.truth), plan, report);
    EXPECT_TRUE(report.verdict.found);
    EXPECT_TRUE(report.verdict.trusted) << report.verdict.line();
    EXPECT_TRUE(report.verdict.advice.empty());
    EXPECT_EQ(report.verdict.by_depth.size(), 7u);
    const Rig off = turned(scene.truth, {0.05, -0.05, 0.0});
    judge(scene.images, finest(scene), scene.truth, both(scene.truth, off), plan, report);
    EXPECT_FALSE(report.verdict.found);
    EXPECT_FALSE(report.verdict.trusted);
    EXPECT_NE(report.verdict.reason.find("px apart"), std::string::npos) << report.verdict.reason;
    EXPECT_NE(report.verdict.advice.find("3 frames are few"), std::string::npos)
        << report.verdict.advice;
}

TEST(Verdict, IsTrustedWithinTheToleranceOnly) {
    const Scene scene = make_scene(5, 150, 4);
    CalibrationOptions options;
    CalibrationReport report;
    report.valid_share = 0.9;
    for (const bool wide : {true, false}) {
        options.tolerance = wide ? Tolerance{50, 100} : Tolerance{1e-3, 2e-3};
        judge(scene.images, finest(scene), scene.truth, both(scene.truth, scene.truth),
              Plan(options), report);
        EXPECT_TRUE(report.verdict.found);
        EXPECT_EQ(report.verdict.trusted, wide) << report.verdict.line();
    }
    EXPECT_NE(report.verdict.advice.find("--tolerance"), std::string::npos);
}

TEST(Verdict, ErrorsBetweenDepthsAreInProportionToInverseDepth) {
    Verdict verdict;
    EXPECT_TRUE(std::isnan(verdict.error_at(5).median));
    verdict.by_depth = {{2, {4, 8}}, {4, {2, 4}}, {kInfinity, {1, 3}}};
    EXPECT_DOUBLE_EQ(verdict.error_at(2).median, 4);
    EXPECT_DOUBLE_EQ(verdict.error_at(1).p95, 16);
    EXPECT_NEAR(verdict.error_at(8.0 / 3).median, 3, 1e-12);
    EXPECT_NEAR(verdict.error_at(8).median, 1.5, 1e-12);
    EXPECT_DOUBLE_EQ(verdict.error_at(kInfinity).median, 1);
    EXPECT_TRUE(std::isnan(verdict.error_at(0).median));
    EXPECT_TRUE(std::isnan(verdict.error_at(-1).p95));
}

}  // namespace
}  // namespace xcalib

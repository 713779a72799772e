#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "solve/solve.hpp"
#include "working_scene.hpp"

namespace xcalib {
namespace {

using namespace ::xcalib::testing;  // NOLINT: working_scene.hpp

CalibrationOptions options_with(int num_threads) {
    CalibrationOptions options;
    options.num_threads = num_threads;
    options.max_iterations = 60;
    return options;
}

LevelReport solve(const Scene& scene, int stage, const CalibrationOptions& options, Rig& rig) {
    const Level level = make_level(scene.images, 1, rig, options.num_threads);
    return solve_level(level, {}, stage, 0.3, 1e-6, Plan(options), rig, rig);
}

void expect_same_camera(const Pinhole& a, const Pinhole& b, double tolerance = 1e-9) {
    EXPECT_NEAR(a.fx, b.fx, tolerance);
    EXPECT_NEAR(a.fy, b.fy, tolerance);
    EXPECT_NEAR(a.cx, b.cx, tolerance);
    EXPECT_NEAR(a.cy, b.cy, tolerance);
    EXPECT_NEAR(a.skew, b.skew, tolerance);
}

TEST(Solve, Stage2RecoversTheWarpFromAPerturbedRig) {
    for (unsigned seed = 1; seed <= 3; ++seed) {
        const Scene scene = make_scene(seed);
        Rig rig = perturbed(scene.truth);
        ASSERT_GT(end_point_error(scene, rig), 1.0);
        const LevelReport report = solve(scene, 2, options_with(2), rig);
        EXPECT_LT(end_point_error(scene, rig), 0.05) << "seed " << seed << ", " << report.stopped;
        EXPECT_LT(report.final_cost, report.initial_cost);
        EXPECT_GT(report.nec, 0.95);
        expect_same_camera(rig.reference, scene.truth.reference);
    }
}

TEST(Solve, TheReportTellsWhatHappened) {
    const Scene scene = make_scene(1);
    Rig rig = perturbed(scene.truth);
    const LevelReport report = solve(scene, 2, options_with(2), rig);
    EXPECT_EQ(report.factor, 1);
    EXPECT_EQ(report.stage, 2);
    EXPECT_EQ(report.width, kWidth);
    EXPECT_EQ(report.height, kHeight);
    EXPECT_GE(report.iterations, 2);
    EXPECT_GT(report.valid_share, 0.5);
    EXPECT_LE(report.valid_share, 1.0);
    EXPECT_GE(report.condition_number, 1.0);
    EXPECT_TRUE(std::isfinite(report.condition_number));
    EXPECT_GE(report.seconds, 0);
    EXPECT_FALSE(report.stopped.empty());
    // The cost is Eq. (image_loss): the mean of 1 - NEC, weighted by c_i.
    EXPECT_NEAR(report.final_cost, 1 - report.nec, 1e-3 * report.final_cost);
}

TEST(Solve, NoFitIsWorseThanItsStart) {
    const Scene scene = make_scene(2);
    Rig rig = scene.truth;
    const LevelReport report = solve(scene, 2, options_with(2), rig);
    EXPECT_LE(report.final_cost, report.initial_cost);
    EXPECT_LT(end_point_error(scene, rig), 0.05);
}

TEST(Solve, Stage1HoldsForwardTranslationPrincipalPointSkewAndRoll) {
    const Scene scene = make_scene(3);
    const Rig start = perturbed(scene.truth);
    Rig rig = start;
    solve(scene, 1, options_with(2), rig);
    expect_same_camera(rig.reference, start.reference);
    EXPECT_NEAR(rig.source.cx, start.source.cx, 1e-9);
    EXPECT_NEAR(rig.source.cy, start.source.cy, 1e-9);
    EXPECT_NEAR(rig.source.skew, start.source.skew, 1e-9);
    EXPECT_NEAR(rig.t().z(), start.t().z(), 1e-12);
    const Eigen::AngleAxisd turn(rig.source_from_reference.rotation *
                                 start.source_from_reference.rotation.inverse());
    const Eigen::Vector3d w = turn.angle() * turn.axis();
    // Turns about x and about y do not commute: what roll there is, is of second order.
    EXPECT_LT(std::abs(w.z()), 0.5 * w.head<2>().squaredNorm() + 1e-9);
    // The others do move, and for the better.
    EXPECT_GT(w.head<2>().norm(), 1e-4);
    EXPECT_NE(rig.source.fx, start.source.fx);
    EXPECT_NE(rig.source.fy, start.source.fy);
    EXPECT_NE(rig.t().x(), start.t().x());
    EXPECT_NE(rig.t().y(), start.t().y());
    EXPECT_LT(end_point_error(scene, rig), end_point_error(scene, start));
}

TEST(Solve, TheStage1PriorHoldsTheTranslationBack) {
    const Scene scene = make_scene(3);
    const Rig start = perturbed(scene.truth);
    const auto travelled = [&](double weight) {
        CalibrationOptions options = options_with(2);
        options.prior_weight = weight;
        Rig rig = start;
        solve(scene, 1, options, rig);
        return (rig.t() - start.t()).norm();
    };
    EXPECT_LT(travelled(1000), 0.2 * travelled(0));
}

TEST(Solve, AKnownSourceCameraStaysInBothStages) {
    const Scene scene = make_scene(4);
    CalibrationOptions options = options_with(2);
    options.source_camera = scene.truth.source;
    Rig rig = perturbed(scene.truth);
    rig.source = scene.truth.source;
    const Rig start = rig;
    for (const int stage : {1, 2}) {
        solve(scene, stage, options, rig);
        expect_same_camera(rig.source, scene.truth.source);
    }
    EXPECT_LT(end_point_error(scene, rig), 0.05);
    EXPECT_GT((rig.t() - start.t()).norm(), 1e-3);
}

TEST(Solve, TheReferenceIsFreedOnRequestOnlyAndNeverWhereItIsKnown) {
    const Scene scene = make_scene(5);
    Rig start = perturbed(scene.truth);
    start.reference.fx *= 1.02;
    start.reference.fy *= 1.02;
    Rig held = start;
    solve(scene, 2, options_with(2), held);
    expect_same_camera(held.reference, start.reference);

    CalibrationOptions options = options_with(2);
    options.optimize_reference = true;
    Rig freed = start;
    solve(scene, 2, options, freed);
    EXPECT_GT(std::abs(freed.reference.fx - start.reference.fx), 1e-3);
    EXPECT_GT(std::abs(freed.reference.cx - start.reference.cx), 1e-6);
    EXPECT_LT(end_point_error(scene, freed), 0.1);

    Rig focal_only = start;  // stage 1 has the reference's focal lengths alone
    solve(scene, 1, options, focal_only);
    EXPECT_GT(std::abs(focal_only.reference.fx - start.reference.fx), 1e-6);
    EXPECT_NEAR(focal_only.reference.cx, start.reference.cx, 1e-9);
    EXPECT_NEAR(focal_only.reference.skew, start.reference.skew, 1e-9);

    options.reference_camera = start.reference;
    Rig known = start;
    solve(scene, 2, options, known);
    expect_same_camera(known.reference, start.reference);
}

bool same_numbers(const Rig& a, const Rig& b) {
    const auto camera = [](const Pinhole& c) {
        return std::vector<double>{c.fx, c.fy, c.cx, c.cy, c.skew};
    };
    return camera(a.source) == camera(b.source) && camera(a.reference) == camera(b.reference) &&
           a.t() == b.t() &&
           a.source_from_reference.rotation.coeffs() == b.source_from_reference.rotation.coeffs();
}

TEST(Solve, TwoRunsAreEqual) {
    const Scene scene = make_scene(6);
    Rig one = perturbed(scene.truth), other = one;
    solve(scene, 2, options_with(1), one);
    solve(scene, 2, options_with(1), other);
    EXPECT_TRUE(same_numbers(one, other));
}

TEST(Solve, TheNumberOfThreadsHasNoSay) {
    const Scene scene = make_scene(6);
    Rig one = perturbed(scene.truth), other = one;
    solve(scene, 2, options_with(1), one);
    solve(scene, 2, options_with(2), other);
    EXPECT_NEAR(one.source.fx / other.source.fx, 1, 1e-6);
    EXPECT_NEAR(one.source.fy / other.source.fy, 1, 1e-6);
    EXPECT_NEAR(one.source.cx, other.source.cx, 1e-6 * one.source.width);
    EXPECT_NEAR(one.source.cy, other.source.cy, 1e-6 * one.source.width);
    EXPECT_NEAR(one.source.skew, other.source.skew, 1e-6 * one.source.width);
    EXPECT_LT((one.R() - other.R()).norm(), 1e-6);
    EXPECT_LT((one.t() - other.t()).norm(), 1e-6);
}

TEST(Pooled, IsTheWeightedMeanOverThePairs) {
    const Scene scene = make_scene(7);
    const Rig rig = perturbed(scene.truth);
    const Level level = make_level(scene.images, 1, rig, 2);
    double weights = 0, nec = 0, share = 0;
    for (std::size_t i = 0; i < 3; ++i) {
        const NecValue value = level.pairs[i]->evaluate(level.rig_at(rig));
        weights += level.weights[i];
        nec += level.weights[i] * value.nec;
        share += value.valid_share / 3;
    }
    EXPECT_NEAR(weights, 1, 1e-12);
    EXPECT_NEAR(pooled(level, rig, 1).nec, nec, 1e-12);
    EXPECT_NEAR(pooled(level, rig, 2).valid_share, share, 1e-12);
}

TEST(Level, HasTheReducedSizesAndASourceOfTheSameDensity) {
    const Scene scene = make_scene(8);
    for (const int factor : {1, 2, 4}) {
        const Level level = make_level(scene.images, factor, scene.truth, 2);
        EXPECT_EQ(level.width, kWidth / factor);
        EXPECT_EQ(level.height, static_cast<int>(std::lround(kHeight / double(factor))));
        const Rig rig = level.rig_at(scene.truth);
        EXPECT_EQ(rig.source.width, level.source_width);
        // So many source pixels to a reference pixel, unless the source has fewer to begin with.
        const double density = rig.source.fx / rig.reference.fx;
        const double most = factor >= kCoarse ? 1 : 2;
        EXPECT_LT(density, 1.05 * most);
        EXPECT_GT(density,
                  0.95 * std::min(most, factor * scene.truth.source.fx / scene.truth.reference.fx));
    }
}

}  // namespace
}  // namespace xcalib

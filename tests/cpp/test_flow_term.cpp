#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "refusal.hpp"
#include "solve/flow_term.hpp"
#include "solve/solve.hpp"
#include "working_scene.hpp"

namespace xcalib {
namespace {

using namespace ::xcalib::testing;  // NOLINT: working_scene.hpp, refusal.hpp

// Pixels of a rig, to be found at places that lie off by up to `spread` source pixels.
FlowTargets random_targets(std::mt19937& random, const Rig& rig, double spread) {
    FlowTargets targets{rig, {}};
    for (int i = 0; i < 200; ++i) {
        const double x = uniform(random, 0, kWidth - 1), y = uniform(random, 0, kHeight - 1);
        const double depth = uniform(random, 3, 20);
        const Eigen::Vector2d at = mapped(rig, x, y, depth);
        targets.targets.push_back({static_cast<float>(x), static_cast<float>(y),
                                   static_cast<float>(depth),
                                   static_cast<float>(at.x() + spread * uniform(random, -1, 1)),
                                   static_cast<float>(at.y() + spread * uniform(random, -1, 1)),
                                   static_cast<float>(uniform(random, 0.1, 1) / 200)});
    }
    return targets;
}

Rig some_rig(std::mt19937& random) { return random_rig(random, kWidth, kHeight, 180, 144); }

TEST(FlowTerm, GradientAgreesWithCentralDifferences) {
    std::mt19937 random(1);
    const Rig rig = some_rig(random);
    const FlowTargets targets = random_targets(random, rig, 3);
    const FlowEquations equations = flow_equations(targets, rig, Parameters(kNumParameters));
    EXPECT_NEAR(equations.value, flow_value(targets, rig), 1e-12);
    for (int p = 0; p < kNumParameters; ++p) {
        const double step = 1e-2 / farthest_move(rig, p);
        const double expected =
            (flow_value(targets, moved(rig, p, step)) - flow_value(targets, moved(rig, p, -step))) /
            (2 * step);
        EXPECT_NEAR(equations.gradient[p], expected, 1e-4 * equations.gradient.norm()) << p;
    }
    const FlowEquations fewer = flow_equations(targets, rig, Parameters(kNumWithoutReference));
    EXPECT_LT((fewer.hessian -
               equations.hessian.topLeftCorner(kNumWithoutReference, kNumWithoutReference))
                  .norm(),
              1e-9 * fewer.hessian.norm());
}

TEST(FlowTerm, IsTheMeanLengthInHalfWidthsFarFromZero) {
    std::mt19937 random(2);
    const Rig rig = some_rig(random);
    FlowTargets targets = random_targets(random, rig, 0);
    double sum = 0;
    for (FlowTarget& target : targets.targets) {
        target.u += 30;
        sum += target.weight;
    }
    const double half_widths = 30 * rig.reference.fx / rig.source.fx / (kWidth / 2);
    EXPECT_NEAR(flow_value(targets, rig), sum * half_widths, 0.02 * sum * half_widths);
}

TEST(FlowTerm, WhatIsBehindTheSourceHasNoSay) {
    std::mt19937 random(3);
    Rig rig = some_rig(random);
    const FlowTargets targets = random_targets(random, rig, 3);
    rig.source_from_reference.translation.z() = -100;
    const FlowEquations equations = flow_equations(targets, rig, Parameters(kNumParameters));
    EXPECT_EQ(equations.value, 0);
    EXPECT_EQ(equations.gradient.norm(), 0);
}

TEST(FlowTerm, TheCostWithDerivativesIsTheCostWithout) {
    std::mt19937 random(4);
    const Rig rig = some_rig(random);
    for (const double spread : {0.01, 0.3, 3.0, 30.0}) {
        const FlowTargets targets = random_targets(random, rig, spread);
        const FlowCost cost(targets, 2.5, Parameters(kNumParameters));
        SolverParameters p = solver_from_rig(rig);
        std::vector<const double*> blocks;
        std::vector<std::vector<double>> storage;
        std::vector<double*> jacobians;
        for (const double* block : RigCost::blocks(p)) blocks.push_back(block);
        for (const int size : cost.parameter_block_sizes())
            storage.emplace_back(cost.num_residuals() * size);
        for (auto& jacobian : storage) jacobians.push_back(jacobian.data());
        const auto half_square = [&](double** with) {
            std::vector<double> residuals(cost.num_residuals());
            EXPECT_TRUE(cost.Evaluate(blocks.data(), residuals.data(), with));
            double sum = 0;
            for (const double r : residuals) sum += 0.5 * r * r;
            return sum;
        };
        const double value = 2.5 * flow_value(targets, rig);
        EXPECT_NEAR(half_square(nullptr), value, 1e-9 * value);
        EXPECT_NEAR(half_square(jacobians.data()), value, 1e-9 * value);
    }
}

// Median distance of the targets from where the truth puts their pixels, and from where `rig` does
// [source px].
std::array<double, 2> distances(const std::vector<FlowTargets>& flow, const Rig& truth,
                                const Rig& rig) {
    std::vector<double> to_truth, to_rig;
    for (const FlowTargets& pair : flow)
        for (const FlowTarget& t : pair.targets) {
            to_truth.push_back(
                (mapped(truth, t.x, t.y, t.depth) - Eigen::Vector2d(t.u, t.v)).norm());
            to_rig.push_back((mapped(rig, t.x, t.y, t.depth) - Eigen::Vector2d(t.u, t.v)).norm());
        }
    const auto median = [](std::vector<double>& values) {
        std::sort(values.begin(), values.end());
        return values.empty() ? INFINITY : values[values.size() / 2];
    };
    return {median(to_truth), median(to_rig)};
}

TEST(FlowTerm, TargetsLieWhereTheTrueRigPutsThePixels) {
    const Scene scene = make_scene(1);
    const Rig rig = turned(scene.truth, {0.02, -0.03, 0.01});
    const std::vector<FlowTargets> flow = estimate_flow(scene.images, 1, rig, nullptr, 24, 2);
    ASSERT_EQ(flow.size(), scene.images.size());
    const auto [to_truth, to_rig] = distances(flow, scene.truth, rig);
    EXPECT_GT(to_rig, 3.0);
    EXPECT_LT(to_truth, 0.5);
    double weights = 0;
    for (const FlowTargets& pair : flow) {
        EXPECT_GT(pair.targets.size(), 20u);
        for (const FlowTarget& target : pair.targets) weights += target.weight;
    }
    EXPECT_NEAR(weights, 1.0, 1e-4);
}

TEST(FlowTerm, AnEstimatorIsGivenImagesAndItsFlowIsTaken) {
    const Scene scene = make_scene(2);
    const Rig rig = turned(scene.truth, {0.0, -0.03, 0.0});
    int calls = 0;
    const FlowEstimator dense = [&](const Image& reference, const Image& warped,
                                    const std::vector<std::uint8_t>& valid) {
        ++calls;
        EXPECT_EQ(warped.pixels.size(), reference.pixels.size());
        EXPECT_EQ(valid.size(), reference.pixels.size());
        const std::size_t count = reference.pixels.size();
        return FlowField{reference.width,
                         reference.height,
                         1,
                         std::vector<float>(count, 4.0f),
                         std::vector<float>(count, -2.0f),
                         std::vector<float>(count, 1.0f)};
    };
    const std::vector<FlowTargets> flow = estimate_flow(scene.images, 1, rig, dense, 24, 2);
    EXPECT_EQ(calls, 3);
    for (std::size_t i = 0; i < flow.size(); ++i) {
        // One vector of each cell of 7 x 7 px, less what leads out of the image.
        EXPECT_GT(flow[i].targets.size(), 450u);
        EXPECT_LE(flow[i].targets.size(), 29u * 22u);
        for (const FlowTarget& t : flow[i].targets) {
            const float there = scene.depths[i].row(static_cast<int>(t.y) - 2)[int(t.x) + 4];
            const Eigen::Vector2d expected = mapped(rig, t.x + 4, t.y - 2, there);
            EXPECT_NEAR(t.u, expected.x(), 1e-3);
            EXPECT_NEAR(t.v, expected.y(), 1e-3);
        }
    }
}

TEST(FlowTerm, AFieldOfAnotherSizeIsRefused) {
    const Scene scene = make_scene(2);
    const FlowEstimator small = [](const Image&, const Image&, const std::vector<std::uint8_t>&) {
        return FlowField{
            5, 4, 1, std::vector<float>(20), std::vector<float>(20), std::vector<float>(20)};
    };
    const std::string message =
        refusal([&] { estimate_flow(scene.images, 1, scene.truth, small, 24, 2); });
    EXPECT_TRUE(has(message, "5x4")) << message;
    EXPECT_TRUE(has(message, "200x150")) << message;
}

// One of them infinite, all weights would be 0 or NaN.
TEST(FlowTerm, AConfidenceThatIsNoneIsRefused) {
    const Scene scene = make_scene(2);
    for (const float confidence : {-0.5f, 1.5f, INFINITY, NAN}) {
        const FlowEstimator wrong = [&](const Image& reference, const Image&,
                                        const std::vector<std::uint8_t>&) {
            const std::size_t count = reference.pixels.size();
            FlowField field{
                reference.width,           reference.height,          1,
                std::vector<float>(count), std::vector<float>(count), std::vector<float>(count)};
            field.confidence[count / 2] = confidence;
            return field;
        };
        const std::string message =
            refusal([&] { estimate_flow(scene.images, 1, scene.truth, wrong, 24, 2); });
        EXPECT_TRUE(has(message, "expected [0, 1]")) << confidence << ": " << message;
    }
}

TEST(FlowTerm, WhereNothingCanBeToldThereIsNoTerm) {
    const Scene scene = make_scene(2);
    const FlowEstimator unsure = [](const Image& reference, const Image&,
                                    const std::vector<std::uint8_t>&) {
        const std::size_t count = reference.pixels.size();
        return FlowField{
            reference.width,           reference.height,          1,
            std::vector<float>(count), std::vector<float>(count), std::vector<float>(count)};
    };
    for (const FlowTargets& pair : estimate_flow(scene.images, 1, scene.truth, unsure, 24, 2)) {
        EXPECT_TRUE(pair.targets.empty());
        EXPECT_EQ(flow_value(pair, scene.truth), 0);
    }
}

TEST(FlowTerm, LeadsTheSolverFromWhereEdgesDoNot) {
    const Scene scene = make_scene(1, 400, 1.5);  // edges meet within a few pixels only
    const Rig away = turned(scene.truth, {0.06, -0.08, 0.01});
    CalibrationOptions options;
    options.num_threads = 2;
    options.prior_weight = 0;
    const auto error = [&](FlowMode mode) {
        options.flow = mode;
        Rig rig = away;
        const Level level = make_level(scene.images, 1, rig, 2);
        solve_stage(scene.images, level, 2, 0.3, 1e-6, Plan(options), rig);
        return end_point_error(scene, rig);
    };
    ASSERT_GT(end_point_error(scene, away), 10.0);
    EXPECT_GT(error(FlowMode::off), 3.0);
    EXPECT_LT(error(FlowMode::on), 0.3);
}

}  // namespace
}  // namespace xcalib

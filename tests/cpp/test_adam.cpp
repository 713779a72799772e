#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "calibrate/adam.hpp"
#include "objective/paper_variables.hpp"
#include "working_scene.hpp"

namespace xcalib {
namespace {

using namespace ::xcalib::testing;  // NOLINT: working_scene.hpp

const auto kNoProgress = [](double) {};

TEST(Adam, VariablesGoToAVectorAndBack) {
    std::mt19937 random(1);
    PaperVector x;
    for (double& value : x) value = uniform(random, 0.5, 1.5);
    EXPECT_EQ(vector_of(paper_of(x)), x);
}

// The rotation vector that takes a to b.
Eigen::Vector3d turn(const Rig& a, const Rig& b) {
    const Eigen::AngleAxisd angle(b.source_from_reference.rotation *
                                  a.source_from_reference.rotation.conjugate());
    return angle.angle() * angle.axis();
}

TEST(Adam, JacobianAgreesWithCentralDifferences) {
    std::mt19937 random(2);
    const Rig rest = random_rig(random, kWidth, kHeight, 180, 144);
    PaperVector x = vector_of(paper_from_rig(rest));
    x.segment<4>(kPaperQuaternion) *= 1.7;  // any norm will do
    const auto rig_at = [&](const PaperVector& at) { return rig_from_paper(paper_of(at), rest); };
    const auto jacobian = paper_jacobian(paper_of(x), rest);
    for (int v = 0; v < kNumPaperVariables; ++v) {
        constexpr double kStep = 1e-5;
        PaperVector up = x, down = x;
        up[v] += kStep;
        down[v] -= kStep;
        const SolverParameters a = solver_from_rig(rig_at(down)), b = solver_from_rig(rig_at(up));
        Eigen::Matrix<double, kNumParameters, 1> change;
        for (int i = 0; i < 2; ++i) change[kSourceK1 + i] = b.source_lens[i] - a.source_lens[i];
        const auto camera = [&](int row, const SolverParameters::Camera& from,
                                const SolverParameters::Camera& to) {
            change.segment<5>(row) << to.log_f[0] - from.log_f[0], to.log_f[1] - from.log_f[1],
                to.center[0] - from.center[0], to.center[1] - from.center[1],
                to.skew_share[0] - from.skew_share[0];
        };
        camera(kSourceLogFx, a.source, b.source);
        camera(kReferenceLogFx, a.reference, b.reference);
        change.segment<3>(kRotationX) = turn(rig_at(down), rig_at(up));
        for (int i = 0; i < 3; ++i) change[kTranslationX + i] = b.translation[i] - a.translation[i];
        EXPECT_LT((jacobian.col(v) - change / (2 * kStep)).norm(),
                  1e-6 * (1 + jacobian.col(v).norm()))
            << v;
    }
}

CalibrationOptions adam_options() {
    CalibrationOptions options;
    options.solver = Solver::adam;
    options.flow = FlowMode::off;
    options.num_threads = 2;
    options.adam.batch = 2;
    options.adam.epochs = 20;
    return options;
}

struct Solved {
    Rig rig;
    CalibrationReport report;
};

Solved solve(const Scene& scene, const Rig& from, const CalibrationOptions& options) {
    Solved out{from, {}};
    solve_adam(scene.images, Plan(options), kNoProgress, out.rig, out.report);
    return out;
}

TEST(Adam, ComesNearerToTheTruth) {
    const Scene scene = make_scene(1);
    const Rig from = perturbed(scene.truth);
    for (const FlowMode flow : {FlowMode::off, FlowMode::on}) {
        CalibrationOptions options = adam_options();
        options.flow = flow;
        options.adam.epochs = flow == FlowMode::on ? 10 : 20;
        const Solved found = solve(scene, from, options);
        EXPECT_LT(end_point_error(scene, found.rig), 0.5 * end_point_error(scene, from));
        const auto& steps = found.report.steps;
        EXPECT_LT(steps.back().image, steps.front().image);
        EXPECT_EQ(steps.front().flow > 0, flow == FlowMode::on);
    }
}

TEST(Adam, KeepsThePublishedSchedule) {
    const Scene scene = make_scene(1);
    CalibrationOptions options = adam_options();
    options.adam.epochs = 4;
    const CalibrationReport report = solve(scene, perturbed(scene.truth), options).report;
    ASSERT_EQ(report.steps.size(), 8u);  // three pairs in batches of two, four times
    for (int i = 0; i < 8; ++i) {
        const AdamStep& step = report.steps[i];
        const double rate = i < 6 ? 5e-3 * std::pow(0.98, i) : 5e-4 * std::pow(0.98, i - 6);
        EXPECT_NEAR(step.learning_rate, rate, 1e-12);
        EXPECT_NEAR(step.total, step.image + (i < 6 ? step.prior : 0), 1e-12);
    }
    EXPECT_EQ(report.steps[0].prior, 0);
    EXPECT_GT(report.steps[5].prior, 0);
    ASSERT_EQ(report.levels.size(), 2u);
    EXPECT_EQ(report.levels[0].stage, 1);
    EXPECT_EQ(report.levels[0].iterations, 6);
    EXPECT_EQ(report.levels[1].stage, 2);
    EXPECT_EQ(report.levels[1].iterations, 2);
}

TEST(Adam, Stage1FreezesWhatThePaperFreezes) {
    const Scene scene = make_scene(2);
    CalibrationOptions options = adam_options();
    options.adam.epochs = 4;
    options.adam.fine_from = 1.0;
    const Rig from = perturbed(scene.truth);
    const Rig rig = solve(scene, from, options).rig;
    for (const auto& [a, b] :
         {std::pair{from.source, rig.source}, {from.reference, rig.reference}}) {
        EXPECT_NEAR(b.cx, a.cx, 1e-9);
        EXPECT_NEAR(b.cy, a.cy, 1e-9);
        EXPECT_NEAR(b.skew, a.skew, 1e-9);
        EXPECT_GT(std::abs(b.fx - a.fx), 1e-3);
    }
    EXPECT_NEAR(rig.t().z(), from.t().z(), 1e-12);
    EXPECT_GT((rig.t() - from.t()).norm(), 1e-3);
}

TEST(Adam, KnownCamerasStay) {
    const Scene scene = make_scene(2);
    CalibrationOptions options = adam_options();
    options.adam.epochs = 4;
    const Rig from = perturbed(scene.truth);
    options.reference_camera = from.reference;
    options.source_camera = from.source;
    const Rig rig = solve(scene, from, options).rig;
    EXPECT_NEAR(rig.reference.fx, from.reference.fx, 1e-9);
    EXPECT_NEAR(rig.source.cx, from.source.cx, 1e-9);
    EXPECT_GT((rig.t() - from.t()).norm(), 1e-3);
}

TEST(Adam, CoarseScalesOfTheTranslationMoveFarther) {
    const Scene scene = make_scene(2);
    CalibrationOptions options = adam_options();
    options.adam.epochs = 1;
    const Rig from = perturbed(scene.truth);
    double before = 0;
    for (const int scales : {1, 2, 3}) {
        options.adam.translation_scales = scales;
        const double moved = (solve(scene, from, options).rig.t() - from.t()).norm();
        EXPECT_GT(moved, 5 * before) << scales << " scales";
        before = moved;
    }
}

TEST(Adam, TheSeedAndNotTheThreadsDecide) {
    const Scene scene = make_scene(3);
    CalibrationOptions options = adam_options();
    options.adam.epochs = 3;
    const auto t = [&](int threads, std::uint32_t seed) {
        options.num_threads = threads;
        options.seed = seed;
        return solve(scene, perturbed(scene.truth), options).rig.t();
    };
    EXPECT_EQ(t(1, 0), t(2, 0));
    EXPECT_NE(t(2, 0), t(2, 1));
}

}  // namespace
}  // namespace xcalib

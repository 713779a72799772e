#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include "scenes.hpp"
#include "solve/nec_cost.hpp"

namespace xcalib {
namespace {

using namespace ::xcalib::testing;  // NOLINT: scenes.hpp

// --- The compressed block
// -------------------------------------------------------------------------

struct Rows {
    Eigen::MatrixXd jacobian;
    Eigen::VectorXd residuals;
};

void expect_same_normal_equations(const Rows& rows) {
    const Eigen::MatrixXd hessian = rows.jacobian.transpose() * rows.jacobian;
    const Eigen::VectorXd gradient = rows.jacobian.transpose() * rows.residuals;
    const double cost = 0.5 * rows.residuals.squaredNorm();
    const CompressedBlock block = compress(hessian, gradient, cost);
    ASSERT_EQ(block.jacobian.rows(), hessian.rows() + 1);
    ASSERT_EQ(block.jacobian.cols(), hessian.cols());
    ASSERT_EQ(block.residuals.size(), hessian.rows() + 1);
    EXPECT_LE((block.jacobian.transpose() * block.jacobian - hessian).norm(),
              1e-9 * hessian.norm());
    EXPECT_LE((block.jacobian.transpose() * block.residuals - gradient).norm(),
              1e-9 * gradient.norm());
    EXPECT_NEAR(0.5 * block.residuals.squaredNorm(), cost, 1e-9 * cost);
    EXPECT_EQ(block.jacobian.row(hessian.rows()).norm(), 0);
}

Rows random_rows(std::mt19937& random, int rows, int columns) {
    Rows out{Eigen::MatrixXd(rows, columns), Eigen::VectorXd(rows)};
    for (int r = 0; r < rows; ++r) {
        out.residuals[r] = uniform(random, -1, 1);
        for (int c = 0; c < columns; ++c) out.jacobian(r, c) = uniform(random, -1, 1);
    }
    return out;
}

TEST(Compress, KeepsTheNormalEquationsAndTheCost) {
    std::mt19937 random(1);
    for (const int columns : {1, 2, int{kNumWithoutReference}, int{kNumParameters}})
        expect_same_normal_equations(random_rows(random, 300, columns));
}

TEST(Compress, KeepsThemWhereColumnsAreScaledVeryDifferently) {
    std::mt19937 random(2);
    Rows rows = random_rows(random, 300, 11);
    for (int c = 0; c < 11; ++c) rows.jacobian.col(c) *= std::pow(10.0, 0.4 * c - 2);
    expect_same_normal_equations(rows);
    rows.jacobian *= 1e-8;
    rows.residuals *= 1e-8;
    expect_same_normal_equations(rows);
}

TEST(Compress, KeepsThemWhereTheHessianIsSingular) {
    std::mt19937 random(3);
    Rows empty = random_rows(random, 300, 11);
    empty.jacobian.col(4).setZero();
    empty.jacobian.col(10).setZero();
    expect_same_normal_equations(empty);
    Rows coupled = random_rows(random, 300, 11);
    coupled.jacobian.col(7) = coupled.jacobian.col(2) - 3 * coupled.jacobian.col(5);
    expect_same_normal_equations(coupled);
    expect_same_normal_equations(random_rows(random, 5, 11));  // fewer rows than columns
}

TEST(Compress, HoldsTheCostAloneWhereThereIsNoJacobian) {
    const CompressedBlock block =
        compress(Eigen::MatrixXd::Zero(11, 11), Eigen::VectorXd::Zero(11), 0.7);
    EXPECT_EQ(block.jacobian.norm(), 0);
    EXPECT_TRUE(block.jacobian.allFinite());
    EXPECT_NEAR(0.5 * block.residuals.squaredNorm(), 0.7, 1e-12);
}

TEST(Compress, KeepsTheEquationsOfARealPair) {
    std::mt19937 random(4);
    const Rig rig = random_rig(random, 64, 48, 60, 45);
    const Field texture = blobs(random, 64, 48, 10, 5, 0.6), depth = rolling_depth(64, 48);
    const Rig near = turned(rig, {0.01, 0.02, -0.01});
    const NecFrame frame = make_nec_frame(drawn(texture, 64, 48), source_view(rig, texture, depth),
                                          drawn(depth, 64, 48), near);
    for (const int count : {int{kNumWithoutReference}, int{kNumParameters}}) {
        const NecRows rows = nec_rows(frame, near, Parameters(count));
        expect_same_normal_equations({rows.jacobian, rows.residuals});
        const NecNormalEquations equations = nec_normal_equations(frame, near, Parameters(count));
        const CompressedBlock block =
            compress(equations.hessian, equations.gradient, 1 - equations.value.nec);
        const Eigen::MatrixXd hessian = rows.jacobian.transpose() * rows.jacobian;
        EXPECT_LT((block.jacobian.transpose() * block.jacobian - hessian).norm(),
                  1e-7 * hessian.norm());
    }
}

// --- The cost as Ceres sees it
// --------------------------------------------------------------------

constexpr int kBlockSizes[] = {2, 2, 1, 4, 3, 2, 2, 1, 2};

struct CostScene {
    Rig truth, rig;
    NecFrame frame;
};

// `off`: how far the rig is from the truth, 1 for a few pixels.
CostScene cost_scene(unsigned seed, double off, int width = 300, int height = 225) {
    std::mt19937 random(seed);
    CostScene scene;
    scene.truth = random_rig(random, width, height, width, height);
    scene.truth.source.fx = scene.truth.source.fy = 0.9 * scene.truth.reference.fx;
    const Field texture = blobs(random, width, height, 14, 0.06 * width, 0.5);
    const Field depth = rolling_depth(width, height);
    scene.rig = turned(scene.truth, off * Eigen::Vector3d(0.01, -0.012, 0.008));
    scene.rig.source_from_reference.translation += off * Eigen::Vector3d(0.05, -0.03, 0.04);
    scene.frame =
        make_nec_frame(drawn(texture, width, height), source_view(scene.truth, texture, depth),
                       drawn(depth, width, height), scene.rig);
    return scene;
}

// A problem of one pair, as the solver sets it up.
struct OnePair {
    SolverParameters parameters;
    ceres::Problem problem;

    NecPair pair;

    OnePair(const NecFrame& frame, const Rig& rig, double weight, bool with_reference)
        : parameters(solver_from_rig(rig)), pair(frame) {
        problem.AddResidualBlock(
            new NecCost(pair, rig, weight, 0.0,
                        Parameters(with_reference ? kNumParameters : kNumWithoutReference)),
            nullptr, NecCost::blocks(parameters));
        problem.SetManifold(parameters.quaternion, new ceres::QuaternionManifold);
    }

    double cost() {
        double value = 0;
        EXPECT_TRUE(problem.Evaluate({}, &value, nullptr, nullptr, nullptr));
        return value;
    }

    // The gradient of the cost, in the tangent of the manifolds.
    std::vector<double> gradient() {
        std::vector<double> values;
        EXPECT_TRUE(problem.Evaluate({}, nullptr, nullptr, &values, nullptr));
        return values;
    }
};

// Ceres' own machinery gives the derivative of the cost by the tangent of every block. As in
// test_nec.cpp it is averaged over the step of the central difference.
TEST(NecCost, GradientThroughTheManifoldAgreesWithCentralDifferences) {
    for (const bool with_reference : {false, true}) {
        const SmoothPair scene = smooth_pair(6, true);
        OnePair pair(scene.frame, scene.rig, 0.3, with_reference);
        std::vector<double> expected, found;
        const std::vector<double*> blocks = NecCost::blocks(pair.parameters);
        for (std::size_t b = 0; b < blocks.size(); ++b) {
            const ceres::Manifold* manifold = pair.problem.GetManifold(blocks[b]);
            const int tangent = manifold ? manifold->TangentSize() : kBlockSizes[b];
            const std::vector<double> at(blocks[b], blocks[b] + kBlockSizes[b]);
            const int first = static_cast<int>(expected.size());
            for (int i = 0; i < tangent; ++i) {
                const double step = 2.5 / farthest_move(scene.rig, first + i);
                const auto go = [&](double s) {
                    std::vector<double> delta(tangent, 0.0), to = at;
                    delta[i] = s;
                    if (manifold) manifold->Plus(at.data(), delta.data(), to.data());
                    else to[i] += s;
                    std::copy(to.begin(), to.end(), blocks[b]);
                };
                go(step);
                const double up = pair.cost();
                go(-step);
                expected.push_back((up - pair.cost()) / (2 * step));
                constexpr int kSamples = 300;
                double sum = 0;
                for (int k = 0; k < kSamples; ++k) {
                    go(step * ((2 * k + 1.0) / kSamples - 1));
                    sum += pair.gradient()[first + i];
                }
                found.push_back(sum / kSamples);
                go(0);
            }
        }
        // The tangent has the dimensions of `Parameter`, in that order.
        ASSERT_EQ(found.size(), std::size_t{kNumParameters});
        for (const ParameterClass& group : kParameterClasses) {
            const bool held = !with_reference && group.first >= kNumWithoutReference;
            double difference = 0, norm = 0;
            for (int p = group.first; p < group.first + group.count; ++p) {
                difference += std::pow(found[p] - (held ? 0 : expected[p]), 2);
                norm += std::pow(expected[p], 2);
            }
            EXPECT_LE(std::sqrt(difference), held ? 0.0 : 1e-4 * std::sqrt(norm)) << group.name;
        }
    }
}

TEST(NecCost, GradientIsThatOfTheNormalEquationsTimesTheWeight) {
    const CostScene scene = cost_scene(1, 1, 80, 60);
    const std::vector<double> found = OnePair(scene.frame, scene.rig, 0.3, true).gradient();
    Eigen::VectorXd expected =
        0.3 * nec_normal_equations(scene.frame, scene.rig, Parameters(kNumParameters)).gradient;
    expected.segment<3>(kRotationX) *= 2;  // Ceres' quaternion steps are half the angle
    ASSERT_EQ(found.size(), std::size_t{kNumParameters});
    for (int p = 0; p < kNumParameters; ++p)
        EXPECT_NEAR(found[p], expected[p], 2e-7 * expected.norm()) << p;
}

TEST(NecCost, TheCostIsTheWeightTimesOneMinusNec) {
    const CostScene scene = cost_scene(4, 1);
    OnePair pair(scene.frame, scene.rig, 0.3, false);
    EXPECT_NEAR(pair.cost(), 0.3 * (1 - evaluate_nec(scene.frame, scene.rig).nec), 1e-9);
}

TEST(NecCost, TheCostWithDerivativesIsTheCostWithout) {
    // Far from the optimum, and so near to it that the rows hold little but what the step removes.
    for (const double off : {2.0, 1.0, 0.3, 0.1, 0.03}) {
        const CostScene scene = cost_scene(5, off, 120, 90);
        OnePair pair(scene.frame, scene.rig, 0.3, false);
        double with = 0;
        std::vector<double> gradient;
        ASSERT_TRUE(pair.problem.Evaluate({}, &with, nullptr, &gradient, nullptr));
        // 1 - NEC of sums of floats: what it loses as it nears 0 is a rounding of 1.
        EXPECT_NEAR(with, pair.cost(), 1e-5 * pair.cost() + 1e-8)
            << "at " << off << " of the displacement";
    }
}

TEST(NecCost, APairThatLosesItsOverlapIsPenalised) {
    const CostScene scene = cost_scene(6, 1);
    const Rig away = turned(scene.rig, {0, 0.45, 0});
    const double share = evaluate_nec(scene.frame, away).valid_share;
    const NecPair images(scene.frame);
    ASSERT_GT(share, 0.05);
    ASSERT_LT(share, 0.8);
    SolverParameters p = solver_from_rig(away);
    std::vector<const double*> blocks;
    for (const double* block : NecCost::blocks(p)) blocks.push_back(block);
    const auto cost_with = [&](double minimum_share) {
        const NecCost cost(images, away, 1.0, minimum_share, Parameters(kNumWithoutReference));
        std::vector<double> residuals(cost.num_residuals());
        EXPECT_TRUE(cost.Evaluate(blocks.data(), residuals.data(), nullptr));
        double sum = 0;
        for (const double r : residuals) sum += 0.5 * r * r;
        return sum;
    };
    EXPECT_NEAR(cost_with(0.0), cost_with(share - 0.01), 1e-12);
    EXPECT_GT(cost_with(share + 0.2), cost_with(0.0) + 0.01);
    EXPECT_GT(cost_with(share + 0.3), cost_with(share + 0.2));
}

TEST(NecCost, BlocksThatAreNotAskedForMayBeLeftOut) {
    const CostScene scene = cost_scene(7, 1, 80, 60);
    const NecPair images(scene.frame);
    const NecCost cost(images, scene.rig, 1.0, 0.0, Parameters(kNumParameters));
    SolverParameters p = solver_from_rig(scene.rig);
    std::vector<const double*> blocks;
    for (const double* block : NecCost::blocks(p)) blocks.push_back(block);
    std::vector<double> residuals(cost.num_residuals());
    std::vector<std::vector<double>> storage;
    for (const int size : kBlockSizes) storage.emplace_back(cost.num_residuals() * size, 7.0);
    std::vector<double*> all, some;
    for (auto& jacobian : storage) all.push_back(jacobian.data());
    ASSERT_TRUE(cost.Evaluate(blocks.data(), residuals.data(), all.data()));
    const std::vector<double> rotation = storage[3];
    std::vector<double> again(rotation.size(), 7.0);
    some.assign(all.size(), nullptr);
    some[3] = again.data();
    ASSERT_TRUE(cost.Evaluate(blocks.data(), residuals.data(), some.data()));
    EXPECT_EQ(again, rotation);
}

// --- Pan and tilt
// ---------------------------------------------------------------------------------

using Quaternion = std::array<double, 4>;  // w x y z

Eigen::Quaterniond eigen(const Quaternion& q) { return {q[0], q[1], q[2], q[3]}; }

Quaternion random_quaternion(std::mt19937& random) {
    Eigen::Vector4d q;
    for (int i = 0; i < 4; ++i) q[i] = uniform(random, -1, 1);
    q.normalize();
    return {q[0], q[1], q[2], q[3]};
}

TEST(TogetherManifold, MovesBothAndBack) {
    const TogetherManifold manifold;
    const double from[2] = {0.25, -1.5}, delta[1] = {0.125};
    double to[2], back[1], plus[2], minus[2];
    ASSERT_TRUE(manifold.Plus(from, delta, to));
    EXPECT_EQ(to[0], 0.375);
    EXPECT_EQ(to[1], -1.375);
    ASSERT_TRUE(manifold.Minus(to, from, back));
    EXPECT_EQ(back[0], delta[0]);
    ASSERT_TRUE(manifold.PlusJacobian(from, plus) && manifold.MinusJacobian(from, minus));
    EXPECT_EQ(plus[0] * minus[0] + plus[1] * minus[1], 1) << "one undoes the other";
}

TEST(PanTiltManifold, PlusTurnsAboutAnAxisInTheSourcesImagePlane) {
    std::mt19937 random(8);
    const PanTiltManifold manifold;
    for (int i = 0; i < 20; ++i) {
        const Quaternion from = random_quaternion(random);
        const double delta[2] = {uniform(random, -0.4, 0.4), uniform(random, -0.4, 0.4)};
        Quaternion to;
        ASSERT_TRUE(manifold.Plus(from.data(), delta, to.data()));
        const Eigen::AngleAxisd turn(eigen(to) * eigen(from).inverse());
        EXPECT_NEAR(turn.axis().z() * turn.angle(), 0, 1e-12) << "no roll";
        // Ceres' quaternion steps are half the angle.
        EXPECT_NEAR(turn.angle(), 2 * std::hypot(delta[0], delta[1]), 1e-12);
        EXPECT_NEAR(eigen(to).norm(), 1, 1e-14);
    }
}

TEST(PanTiltManifold, MinusInvertsPlus) {
    std::mt19937 random(9);
    const PanTiltManifold manifold;
    for (int i = 0; i < 20; ++i) {
        const Quaternion from = random_quaternion(random);
        const double delta[2] = {uniform(random, -0.4, 0.4), uniform(random, -0.4, 0.4)};
        Quaternion to;
        double back[2];
        ASSERT_TRUE(manifold.Plus(from.data(), delta, to.data()));
        ASSERT_TRUE(manifold.Minus(to.data(), from.data(), back));
        EXPECT_NEAR(back[0], delta[0], 1e-12);
        EXPECT_NEAR(back[1], delta[1], 1e-12);
    }
}

TEST(PanTiltManifold, JacobiansAreThoseOfPlusAndMinus) {
    std::mt19937 random(10);
    const PanTiltManifold manifold;
    EXPECT_EQ(manifold.AmbientSize(), 4);
    EXPECT_EQ(manifold.TangentSize(), 2);
    for (int i = 0; i < 20; ++i) {
        const Quaternion at = random_quaternion(random);
        Eigen::Matrix<double, 4, 2, Eigen::RowMajor> plus;
        Eigen::Matrix<double, 2, 4, Eigen::RowMajor> minus;
        ASSERT_TRUE(manifold.PlusJacobian(at.data(), plus.data()));
        ASSERT_TRUE(manifold.MinusJacobian(at.data(), minus.data()));
        constexpr double kStep = 1e-6;
        for (int c = 0; c < 2; ++c) {
            double delta[2] = {0, 0};
            Quaternion up, down;
            delta[c] = kStep;
            manifold.Plus(at.data(), delta, up.data());
            delta[c] = -kStep;
            manifold.Plus(at.data(), delta, down.data());
            for (int r = 0; r < 4; ++r)
                EXPECT_NEAR(plus(r, c), (up[r] - down[r]) / (2 * kStep), 1e-8);
        }
        EXPECT_LT((minus * plus - Eigen::Matrix2d::Identity()).norm(), 1e-12);
    }
}

}  // namespace
}  // namespace xcalib

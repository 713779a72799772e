#include <gtest/gtest.h>

#include <cmath>

#include "same_rig.hpp"
#include "scenes.hpp"
#include "xcalib/parameters.hpp"

namespace xcalib {
namespace {

using ::xcalib::testing::expect_same;
using ::xcalib::testing::random_rig;

constexpr double kPi = 3.14159265358979323846;

const Pinhole kCamera{640, 480, 500, 400, 320, 240, 10};
const Rig kRest{Pinhole::from_hfov(640, 480, 1), Pinhole::from_hfov(320, 256, 1), {}};

TEST(PaperParameters, StartAt45DegreesSquarePixelsAndTheImageCentre) {
    const Rig rig = rig_from_paper(PaperParameters{}, kRest);
    for (const Pinhole& camera : {rig.reference, rig.source}) {
        EXPECT_NEAR(camera.hfov(), kPi / 4, 1e-14);
        EXPECT_NEAR(camera.fy, camera.fx, 1e-10);
        EXPECT_DOUBLE_EQ(camera.cx, (camera.width - 1) / 2.0);
        EXPECT_DOUBLE_EQ(camera.cy, (camera.height - 1) / 2.0);
        EXPECT_EQ(camera.skew, 0);
    }
    EXPECT_EQ(rig.R(), Eigen::Matrix3d::Identity());
    EXPECT_EQ(rig.t(), Eigen::Vector3d::Zero());
}

TEST(PaperParameters, FocalParametersScaleTheAngleOfView) {
    PaperParameters parameters;
    parameters.source.fx = 2;  // twice 45 deg
    parameters.source.fy = 0.5;
    const Rig rig = rig_from_paper(parameters, kRest);
    EXPECT_NEAR(rig.source.hfov(), kPi / 2, 1e-14);
    EXPECT_NEAR(rig.source.vfov(), std::atan(256.0 / 320 * std::tan(kPi / 8)), 1e-14);
    EXPECT_NEAR(rig.reference.hfov(), kPi / 4, 1e-14);
}

TEST(PaperParameters, CoarseTranslationWeighsTenTimesTheFine) {
    EXPECT_EQ(kPaperTranslationScale, 10);
    PaperParameters parameters;
    parameters.translation.col(0) = Eigen::Vector3d(1, 2, 3);
    parameters.translation.col(1) = Eigen::Vector3d(0.1, 0.2, -0.3);
    const Rig rig = rig_from_paper(parameters, kRest);
    EXPECT_LT((rig.t() - Eigen::Vector3d(2, 4, 0)).norm(), 1e-14);
}

TEST(PaperParameters, QuaternionsOfAnyNormAreTheSameRotation) {
    PaperParameters parameters;
    Eigen::Matrix3d quarter_turn;  // about z: x becomes y
    quarter_turn << 0, -1, 0, 1, 0, 0, 0, 0, 1;
    for (const double norm : {1e-3, 1.0, 7.5, -2.0}) {
        parameters.quaternion = norm * Eigen::Vector4d(1, 0, 0, 1);
        const Rig rig = rig_from_paper(parameters, kRest);
        EXPECT_LT((rig.R() - quarter_turn).norm(), 1e-14);
        EXPECT_NEAR(rig.source_from_reference.rotation.norm(), 1, 1e-15);
    }
}

TEST(PaperParameters, ConvertBothWays) {
    std::mt19937 random(4);
    for (int i = 0; i < 50; ++i) {
        const Rig rig = random_rig(random, 640, 480, 320, 256);
        expect_same(rig_from_paper(paper_from_rig(rig), kRest), rig, 1e-9);

        PaperParameters parameters = paper_from_rig(rig);
        parameters.translation.col(1) = Eigen::Vector3d(0.01, -0.02, 0.005);
        const PaperParameters back = paper_from_rig(rig_from_paper(parameters, kRest));
        EXPECT_NEAR(back.source.fx, parameters.source.fx, 1e-12);
        EXPECT_NEAR(back.source.fy, parameters.source.fy, 1e-12);
        EXPECT_NEAR(back.reference.cx, parameters.reference.cx, 1e-12);
        EXPECT_NEAR(back.reference.cy, parameters.reference.cy, 1e-12);
        EXPECT_NEAR(back.reference.skew, parameters.reference.skew, 1e-12);
        EXPECT_LT((back.quaternion - parameters.quaternion).norm(), 1e-12);
        EXPECT_LT(
            (back.translation.col(0) - parameters.translation * Eigen::Vector3d(1, 10, 100)).norm(),
            1e-12);
    }
}

TEST(SolverParameters, AreDimensionless) {
    const Rig rig{kCamera, Pinhole::from_hfov(320, 256, kPi / 2), {}};
    const SolverParameters p = solver_from_rig(rig);
    EXPECT_DOUBLE_EQ(p.reference.log_f[0], std::log(500.0 / 640));
    EXPECT_DOUBLE_EQ(p.reference.log_f[1], std::log(400.0 / 480));
    EXPECT_DOUBLE_EQ(p.reference.center[0], 320.5 / 640);
    EXPECT_DOUBLE_EQ(p.reference.center[1], 240.5 / 480);
    EXPECT_DOUBLE_EQ(p.reference.skew_share[0], 10.0 / 640);
    EXPECT_NEAR(p.source.log_f[0], std::log(0.5), 1e-15);
    EXPECT_DOUBLE_EQ(p.source.center[0], 0.5);
    EXPECT_EQ(p.quaternion[0], 1);
}

TEST(SolverParameters, ConvertBothWays) {
    std::mt19937 random(5);
    for (int i = 0; i < 50; ++i) {
        const Rig rig = random_rig(random, 640, 480, 320, 256);
        expect_same(rig_from_solver(solver_from_rig(rig), kRest), rig, 1e-9);
    }
}

TEST(SolverParameters, AreTheSameAtEveryPyramidLevel) {
    std::mt19937 random(6);
    const Rig rig = random_rig(random, 640, 480, 320, 256);
    const Rig small = rig.resized(80, 60, 53, 43);
    expect_same(rig_from_solver(solver_from_rig(rig), kRest.resized(80, 60, 53, 43)), small, 1e-10);
    expect_same(rig_from_solver(solver_from_rig(small), kRest), rig, 1e-9);
}

TEST(SolverParameters, AQuaternionOffTheSphereIsNormalized) {
    SolverParameters p = solver_from_rig(Rig{kCamera, kCamera, {}});
    p.quaternion[3] = 1;  // (1, 0, 0, 1): a quarter turn about z
    const Rig rig = rig_from_solver(p, Rig{kCamera, kCamera, {}});
    EXPECT_NEAR(rig.source_from_reference.rotation.norm(), 1, 1e-15);
    EXPECT_LT((rig.R() * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY()).norm(), 1e-14);
}

TEST(SolverParameters, HaveK1AndK2OfALensThatIsAPolynomial) {
    Rig rig{kCamera, kCamera, {}};
    SolverParameters p = solver_from_rig(rig);
    EXPECT_FALSE(rig_from_solver(p, rig).source.lens.bends()) << "what is none stays none";
    p.source_lens[0] = -0.25;
    p.source_lens[1] = 0.0625;
    EXPECT_EQ(rig_from_solver(p, rig).source.lens, Lens(LensModel::brown, {-0.25, 0.0625, 0, 0}));
    rig.source.lens = Lens(LensModel::brown, {0.1, 0.2, 0.01, 0.02, 0.3});
    EXPECT_EQ(rig_from_solver(p, rig).source.lens,
              Lens(LensModel::brown, {-0.25, 0.0625, 0.01, 0.02, 0.3}));
    rig.source.lens = Lens(LensModel::fisheye, {0.1, 0.2, 0, 0});
    EXPECT_EQ(rig_from_solver(p, rig).source.lens, rig.source.lens) << "which has other ones";
}

}  // namespace
}  // namespace xcalib

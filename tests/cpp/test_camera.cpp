#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <string>

#include "refusal.hpp"
#include "scenes.hpp"
#include "xcalib/camera.hpp"

namespace xcalib {
namespace {

using ::xcalib::testing::has;
using ::xcalib::testing::random_rig;
using ::xcalib::testing::refusal;
using ::xcalib::testing::uniform;

constexpr double kPi = 3.14159265358979323846;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

const Pinhole kCamera{640, 480, 500, 400, 320, 240, 10};

void expect_same(const Pinhole& a, const Pinhole& b, double tolerance) {
    EXPECT_EQ(a.width, b.width);
    EXPECT_EQ(a.height, b.height);
    EXPECT_NEAR(a.fx, b.fx, tolerance);
    EXPECT_NEAR(a.fy, b.fy, tolerance);
    EXPECT_NEAR(a.cx, b.cx, tolerance);
    EXPECT_NEAR(a.cy, b.cy, tolerance);
    EXPECT_NEAR(a.skew, b.skew, tolerance);
}

void expect_same(const Rig& a, const Rig& b, double tolerance) {
    expect_same(a.reference, b.reference, tolerance);
    expect_same(a.source, b.source, tolerance);
    EXPECT_LT((a.R() - b.R()).norm(), tolerance);
    EXPECT_LT((a.t() - b.t()).norm(), tolerance);
}

TEST(Camera, ProjectsAPointWorkedOutByHand) {
    // x = 1/4, y = 1/2: u = 500/4 + 10/2 + 320, v = 400/2 + 240.
    const Eigen::Vector2d pixel = project(kCamera, {1, 2, 4});
    EXPECT_DOUBLE_EQ(pixel.x(), 450);
    EXPECT_DOUBLE_EQ(pixel.y(), 440);
}

TEST(Camera, UnprojectsThatPixelToThePoint) {
    const Eigen::Vector3d point = unproject(kCamera, 450, 440, 4);
    EXPECT_NEAR(point.x(), 1, 1e-14);
    EXPECT_NEAR(point.y(), 2, 1e-14);
    EXPECT_EQ(point.z(), 4);
}

TEST(Camera, AxesPointRightDownAndForward) {
    const Pinhole camera = Pinhole::from_hfov(101, 81, 1.0);
    EXPECT_GT(project(camera, {0.1, 0, 1}).x(), 50);
    EXPECT_GT(project(camera, {0, 0.1, 1}).y(), 40);
    const Eigen::Vector2d middle = project(camera, {0, 0, 7});
    EXPECT_DOUBLE_EQ(middle.x(), 50);  // pixel centres at integers: 0..100
    EXPECT_DOUBLE_EQ(middle.y(), 40);
}

TEST(Camera, UnprojectInvertsProjectWithSkew) {
    std::mt19937 random(1);
    for (int i = 0; i < 200; ++i) {
        const Pinhole camera = random_rig(random, 640, 480, 640, 512).reference;
        const double u = uniform(random, -100, 740), v = uniform(random, -100, 580);
        const double z = uniform(random, 0.1, 100);
        const Eigen::Vector2d back = project(camera, unproject(camera, u, v, z));
        EXPECT_NEAR(back.x(), u, 1e-10);
        EXPECT_NEAR(back.y(), v, 1e-10);
    }
}

TEST(Camera, KIsTheProjectionAsAMatrix) {
    const Eigen::Vector3d point(0.3, -0.7, 2.5);
    const Eigen::Vector2d by_matrix = (kCamera.K() * point).hnormalized();
    EXPECT_LT((by_matrix - project(kCamera, point)).norm(), 1e-12);
}

TEST(Camera, ResizingMovesAPixelToFxPlusHalfOfFMinusOne) {
    const Eigen::Vector3d point(0.4, -0.3, 2);
    for (const double f : {0.25, 0.5, 2.0, 3.0}) {
        const Pinhole resized =
            kCamera.resized(static_cast<int>(640 * f), static_cast<int>(480 * f));
        const Eigen::Vector2d before = project(kCamera, point), after = project(resized, point);
        EXPECT_NEAR(after.x(), f * before.x() + (f - 1) / 2, 1e-10);
        EXPECT_NEAR(after.y(), f * before.y() + (f - 1) / 2, 1e-10);
    }
}

TEST(Camera, ResizingStretchesEachAxisByItsOwnFactor) {
    const Pinhole resized = kCamera.resized(320, 120);
    EXPECT_DOUBLE_EQ(resized.fx, 250);
    EXPECT_DOUBLE_EQ(resized.fy, 100);
    EXPECT_DOUBLE_EQ(resized.cx, 320.5 / 2 - 0.5);
    EXPECT_DOUBLE_EQ(resized.cy, 240.5 / 4 - 0.5);
    EXPECT_DOUBLE_EQ(resized.skew, 5);  // px of x per unit of Y/Z
}

TEST(Camera, ResizingThereAndBackChangesNothing) {
    expect_same(kCamera.resized(211, 99).resized(640, 480), kCamera, 1e-10);
}

TEST(Camera, ResizingToNothingIsRefused) {
    EXPECT_TRUE(has(refusal([] { kCamera.resized(0, 480); }), "width = 0"));
    EXPECT_TRUE(has(refusal([] { kCamera.resized(640, -1); }), "height = -1"));
}

TEST(Camera, FieldOfViewOf90DegreesHasAFocalLengthOfHalfTheWidth) {
    const Pinhole camera = Pinhole::from_hfov(640, 480, kPi / 2);
    EXPECT_NEAR(camera.fx, 320, 1e-10);
    EXPECT_EQ(camera.fy, camera.fx);
    EXPECT_EQ(camera.cx, 319.5);
    EXPECT_EQ(camera.cy, 239.5);
    EXPECT_EQ(camera.skew, 0);
    EXPECT_NEAR(camera.hfov(), kPi / 2, 1e-14);
    EXPECT_NEAR(camera.vfov(), 2 * std::atan(0.75), 1e-14);
}

TEST(Camera, ImpossibleFieldsOfViewAreRefused) {
    for (const double hfov : {0.0, -1.0, kPi, 4.0, kNaN})
        EXPECT_TRUE(has(refusal([&] { Pinhole::from_hfov(640, 480, hfov); }), "hfov"));
}

TEST(Camera, ValidationNamesCameraFieldValueAndRange) {
    kCamera.validate("reference");
    struct Case {
        void (*spoil)(Pinhole&);
        const char* text;
    };
    const Case cases[] = {
        {[](Pinhole& c) { c.width = 0; }, "reference: width = 0, expected at least 1 px"},
        {[](Pinhole& c) { c.height = -3; }, "reference: height = -3, expected at least 1 px"},
        {[](Pinhole& c) { c.fx = 0; }, "reference: fx = 0, expected a finite number > 0"},
        {[](Pinhole& c) { c.fx = kInfinity; }, "reference: fx = inf"},
        {[](Pinhole& c) { c.fy = -2.5; }, "reference: fy = -2.5, expected a finite number > 0"},
        {[](Pinhole& c) { c.fy = kNaN; }, "reference: fy = "},
        {[](Pinhole& c) { c.cx = kNaN; }, "reference: cx = "},
        {[](Pinhole& c) { c.cy = -kInfinity; }, "reference: cy = -inf"},
        {[](Pinhole& c) { c.skew = kNaN; }, "reference: skew = "},
    };
    for (const Case& each : cases) {
        Pinhole camera = kCamera;
        each.spoil(camera);
        EXPECT_TRUE(has(refusal([&] { camera.validate("reference"); }), each.text));
    }
}

TEST(Camera, RigValidationNamesTheCameraAndThePose) {
    Rig rig{kCamera, kCamera, {}};
    rig.validate();
    Rig spoilt = rig;
    spoilt.source.fx = -1;
    EXPECT_TRUE(has(refusal([&] { spoilt.validate(); }), "source: fx = -1"));
    spoilt = rig;
    spoilt.source_from_reference.rotation = Eigen::Quaterniond(2, 0, 0, 0);
    EXPECT_TRUE(has(refusal([&] { spoilt.validate(); }), "quaternion = 2, expected 1"));
    spoilt = rig;
    spoilt.source_from_reference.rotation = Eigen::Quaterniond(kNaN, 0, 0, 0);
    EXPECT_TRUE(has(refusal([&] { spoilt.validate(); }), "quaternion"));
    spoilt = rig;
    spoilt.source_from_reference.translation.y() = kInfinity;
    EXPECT_TRUE(has(refusal([&] { spoilt.validate(); }), "translation = inf"));
}

TEST(Camera, RigResizesEachCameraToItsOwnSize) {
    std::mt19937 random(2);
    const Rig rig = random_rig(random, 640, 480, 320, 256);
    const Rig small = rig.resized(160, 120, 80, 64);
    expect_same(small.reference, rig.reference.resized(160, 120), 0);
    expect_same(small.source, rig.source.resized(80, 64), 0);
    EXPECT_EQ(small.R(), rig.R());
    EXPECT_EQ(small.t(), rig.t());
}

TEST(InfiniteHomography, SendsAPixelWhereAPointAMillionKilometresAwayIsSeen) {
    std::mt19937 random(3);
    for (int i = 0; i < 50; ++i) {
        const Rig rig = random_rig(random, 640, 480, 320, 256);
        const Eigen::Vector2d x(uniform(random, 0, 639), uniform(random, 0, 479));
        const Eigen::Vector2d by_homography =
            (infinite_homography(rig) * x.homogeneous()).hnormalized();
        const Eigen::Vector3d far = unproject(rig.reference, x.x(), x.y(), 1e9);
        EXPECT_LT((by_homography - project(rig.source, rig.R() * far + rig.t())).norm(), 1e-6);
    }
}

TEST(PaperParameters, StartAt45DegreesSquarePixelsAndTheImageCentre) {
    const Rig rig = rig_from_paper(PaperParameters{}, 640, 480, 320, 256);
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
    const Rig rig = rig_from_paper(parameters, 640, 480, 320, 256);
    EXPECT_NEAR(rig.source.hfov(), kPi / 2, 1e-14);
    EXPECT_NEAR(rig.source.vfov(), std::atan(256.0 / 320 * std::tan(kPi / 8)), 1e-14);
    EXPECT_NEAR(rig.reference.hfov(), kPi / 4, 1e-14);
}

TEST(PaperParameters, CoarseTranslationWeighsTenTimesTheFine) {
    EXPECT_EQ(kPaperTranslationScale, 10);
    PaperParameters parameters;
    parameters.translation.col(0) = Eigen::Vector3d(1, 2, 3);
    parameters.translation.col(1) = Eigen::Vector3d(0.1, 0.2, -0.3);
    const Rig rig = rig_from_paper(parameters, 640, 480, 320, 256);
    EXPECT_LT((rig.t() - Eigen::Vector3d(2, 4, 0)).norm(), 1e-14);
}

TEST(PaperParameters, QuaternionsOfAnyNormAreTheSameRotation) {
    PaperParameters parameters;
    Eigen::Matrix3d quarter_turn;  // about z: x becomes y
    quarter_turn << 0, -1, 0, 1, 0, 0, 0, 0, 1;
    for (const double norm : {1e-3, 1.0, 7.5, -2.0}) {
        parameters.quaternion = norm * Eigen::Vector4d(1, 0, 0, 1);
        const Rig rig = rig_from_paper(parameters, 640, 480, 320, 256);
        EXPECT_LT((rig.R() - quarter_turn).norm(), 1e-14);
        EXPECT_NEAR(rig.source_from_reference.rotation.norm(), 1, 1e-15);
    }
}

TEST(PaperParameters, ConvertBothWays) {
    std::mt19937 random(4);
    for (int i = 0; i < 50; ++i) {
        const Rig rig = random_rig(random, 640, 480, 320, 256);
        expect_same(rig_from_paper(paper_from_rig(rig), 640, 480, 320, 256), rig, 1e-9);

        PaperParameters parameters = paper_from_rig(rig);
        parameters.translation.col(1) = Eigen::Vector3d(0.01, -0.02, 0.005);
        const PaperParameters back = paper_from_rig(rig_from_paper(parameters, 640, 480, 320, 256));
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
    EXPECT_DOUBLE_EQ(p.reference.skew[0], 10.0 / 640);
    EXPECT_NEAR(p.source.log_f[0], std::log(0.5), 1e-15);
    EXPECT_DOUBLE_EQ(p.source.center[0], 0.5);
    EXPECT_EQ(p.quaternion[0], 1);
}

TEST(SolverParameters, ConvertBothWays) {
    std::mt19937 random(5);
    for (int i = 0; i < 50; ++i) {
        const Rig rig = random_rig(random, 640, 480, 320, 256);
        expect_same(rig_from_solver(solver_from_rig(rig), 640, 480, 320, 256), rig, 1e-9);
    }
}

TEST(SolverParameters, AreTheSameAtEveryPyramidLevel) {
    std::mt19937 random(6);
    const Rig rig = random_rig(random, 640, 480, 320, 256);
    const Rig small = rig.resized(80, 60, 53, 43);
    expect_same(rig_from_solver(solver_from_rig(rig), 80, 60, 53, 43), small, 1e-10);
    expect_same(rig_from_solver(solver_from_rig(small), 640, 480, 320, 256), rig, 1e-9);
}

TEST(SolverParameters, AQuaternionOffTheSphereIsNormalized) {
    SolverParameters p = solver_from_rig(Rig{kCamera, kCamera, {}});
    p.quaternion[3] = 1;  // (1, 0, 0, 1): a quarter turn about z
    const Rig rig = rig_from_solver(p, 640, 480, 640, 480);
    EXPECT_NEAR(rig.source_from_reference.rotation.norm(), 1, 1e-15);
    EXPECT_LT((rig.R() * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY()).norm(), 1e-14);
}

}  // namespace
}  // namespace xcalib

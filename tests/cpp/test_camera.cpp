#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <string>

#include "refusal.hpp"
#include "same_rig.hpp"
#include "scenes.hpp"
#include "views.hpp"
#include "xcalib/camera.hpp"

namespace xcalib {
namespace {

using ::xcalib::testing::expect_same;
using ::xcalib::testing::has;
using ::xcalib::testing::kInfinity;
using ::xcalib::testing::kNaN;
using ::xcalib::testing::random_rig;
using ::xcalib::testing::refusal;
using ::xcalib::testing::uniform;

constexpr double kPi = 3.14159265358979323846;

const Pinhole kCamera{640, 480, 500, 400, 320, 240, 10};

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
    for (const double hfov : {0.0, -1.0, kPi, 4.0, double{kNaN}})
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

}  // namespace
}  // namespace xcalib

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <vector>

#include "geometry/projector.hpp"
#include "refusal.hpp"
#include "scenes.hpp"
#include "views.hpp"
#include "xcalib/lens.hpp"

namespace xcalib {
namespace {

using ::xcalib::testing::kInfinity;
using ::xcalib::testing::random_bent_rig;
using ::xcalib::testing::random_lens;
using ::xcalib::testing::refusal;
using ::xcalib::testing::uniform;

TEST(Lens, BrownShowsAPointWhereItIsWorkedOutByHand) {
    // r2 = 1/4 + 1/4 = 1/2; f = 1 - 0.2/2 + 0.1/4 = 0.925.
    const Lens lens(LensModel::brown, {-0.2, 0.1, 0.01, 0.02});
    const auto shown = lens.distort({0.5, -0.5});
    ASSERT_TRUE(shown);
    EXPECT_NEAR(shown->x(), 0.4625 + 2 * 0.01 * -0.25 + 0.02 * (0.5 + 0.5), 1e-15);
    EXPECT_NEAR(shown->y(), -0.4625 + 0.01 * (0.5 + 0.5) + 2 * 0.02 * -0.25, 1e-15);
}

TEST(Lens, RationalDividesByHand) {
    // r2 = 1: (1 + 0.1 + 0.2 + 0.3) / (1 + 0.2 + 0.1 + 0.3) = 1.
    const Lens lens(LensModel::brown, {0.1, 0.2, 0, 0, 0.3, 0.2, 0.1, 0.3});
    const auto shown = lens.distort({0.6, 0.8});
    ASSERT_TRUE(shown);
    EXPECT_NEAR(shown->x(), 0.6, 1e-15);
    EXPECT_NEAR(shown->y(), 0.8, 1e-15);
}

TEST(Lens, FisheyeShowsAnglesAsLengths) {
    const Lens equidistant(LensModel::fisheye, {0, 0, 0, 0});
    const auto shown = equidistant.distort({std::tan(1.2), 0});
    ASSERT_TRUE(shown);
    EXPECT_NEAR(shown->x(), 1.2, 1e-15);
    EXPECT_EQ(shown->y(), 0);
    EXPECT_EQ(*equidistant.distort({0, 0}), Eigen::Vector2d(0, 0));
    const Lens lens(LensModel::fisheye, {0.1, 0, 0, 0});
    EXPECT_NEAR(lens.distort({0, std::tan(0.5)})->y(), 0.5 * (1 + 0.1 * 0.25), 1e-15);
}

TEST(Lens, ShowsNothingBeyondTheRadiusWhereItFoldsBack) {
    // r (1 - r^2 / 3) stops growing at r = 1.
    const Lens brown(LensModel::brown, {-1.0 / 3, 0, 0, 0});
    EXPECT_NEAR(brown.max_radius(), 1, 1e-12);
    EXPECT_TRUE(brown.distort({0.999, 0}));
    EXPECT_FALSE(brown.distort({0.8, 0.7}));
    EXPECT_FALSE(brown.distort({2, 0})) << "which would be shown at -2/3";
    EXPECT_TRUE(brown.undistort({0.666, 0}));
    EXPECT_FALSE(brown.undistort({0.667, 0})) << "the image is empty there";
    // theta (1 - theta^2 / 3) at theta = 1.
    EXPECT_NEAR(Lens(LensModel::fisheye, {-1.0 / 3, 0, 0, 0}).max_radius(), std::tan(1), 1e-12);
    EXPECT_EQ(Lens(LensModel::fisheye, {0, 0, 0, 0}).max_radius(), kInfinity);
    EXPECT_EQ(Lens(LensModel::brown, {0.2, 0.1, 0, 0}).max_radius(), kInfinity);
    EXPECT_EQ(Lens().max_radius(), kInfinity);
    // r / (1 - r^2 / 4) grows up to its pole.
    EXPECT_NEAR(Lens(LensModel::brown, {0, 0, 0, 0, 0, -0.25, 0, 0}).max_radius(), 2, 1e-12);
    // r / (1 + r^2) at 1.
    EXPECT_NEAR(Lens(LensModel::brown, {0, 0, 0, 0, 0, 1, 0, 0}).max_radius(), 1, 1e-12);
}

TEST(Lens, TheFirstFoldCountsHoweverManyThereAre) {
    // dr'/dr = 1 - 3 a s + 5 b s^2 = (1 - s) (1 - s / 1.2): falls between 1 and 1.2.
    const Lens lens(LensModel::brown, {-(1 + 1 / 1.2) / 3, 1 / 1.2 / 5, 0, 0});
    EXPECT_NEAR(lens.max_radius(), 1, 1e-9);
    // The same, with no root: k2 makes up for k1.
    EXPECT_EQ(Lens(LensModel::brown, {-0.4, 0.1, 0, 0}).max_radius(), kInfinity);
}

TEST(Lens, UndistortInvertsDistortWhereverThereIsAnImage) {
    std::mt19937 random(1);
    int compared = 0;
    for (int i = 0; i < 3000; ++i) {
        const Lens lens = random_lens(random);
        const double most = std::min(2.0, 0.9 * lens.max_radius());
        const double r = uniform(random, 0, most), direction = uniform(random, 0, 6.28);
        const Eigen::Vector2d point(r * std::cos(direction), r * std::sin(direction));
        // Where r' hardly grows, p1 and p2 are enough to fold the image: two points are shown
        // there.
        if (lens.derivative(point).inverse().norm() > 50) continue;
        const auto shown = lens.distort(point);
        ASSERT_TRUE(shown);
        const auto back = lens.undistort(*shown);
        ASSERT_TRUE(back) << i << ": " << point.transpose();
        EXPECT_LT((*back - point).norm(), 1e-9) << i << ": " << point.transpose();
        ++compared;
    }
    EXPECT_GT(compared, 2900);
}

TEST(Lens, DerivativesAgreeWithCentralDifferences) {
    std::mt19937 random(2);
    for (int i = 0; i < 300; ++i) {
        Lens lens = random_lens(random);
        const double most = std::min(1.5, 0.9 * lens.max_radius()) / std::sqrt(2.0);
        const Eigen::Vector2d point(uniform(random, -most, most), uniform(random, -most, most));
        constexpr double kStep = 1e-6;
        Eigen::Matrix2d numeric;
        for (int axis = 0; axis < 2; ++axis) {
            const Eigen::Vector2d step = kStep * Eigen::Vector2d::Unit(axis);
            numeric.col(axis) =
                (*lens.distort(point + step) - *lens.distort(point - step)) / (2 * kStep);
        }
        EXPECT_LT((lens.derivative(point) - numeric).norm(), 1e-7 * numeric.norm()) << i;
    }
    const Lens fisheye(LensModel::fisheye, {0.1, 0, 0, 0});
    EXPECT_EQ(fisheye.derivative({0, 0}), Eigen::Matrix2d::Identity()) << "on the axis";
}

TEST(Lens, FlippedIsWhatAMirrorImageShows) {
    std::mt19937 random(3);
    for (int i = 0; i < 100; ++i) {
        const Lens lens = random_lens(random);
        const auto shown = lens.distort({0.3, -0.2}),
                   flipped = lens.flipped().distort({-0.3, -0.2});
        EXPECT_NEAR(flipped->x(), -shown->x(), 1e-15);
        EXPECT_NEAR(flipped->y(), shown->y(), 1e-15);
        EXPECT_EQ(lens.flipped().flipped(), lens);
    }
}

TEST(Lens, RefusesWhatItCannotBe) {
    const auto refused = [](LensModel model, const std::vector<double>& coefficients) {
        return refusal([&] { Lens(model, coefficients); });
    };
    EXPECT_EQ(refused(LensModel::brown, {1, 2, 3}),
              "a lens of model brown has 3 coefficients, expected 4 (k1 k2 p1 p2), 5 (... k3) or 8 "
              "(... k4 k5 k6)");
    EXPECT_EQ(refused(LensModel::fisheye, {1, 2, 3, 4, 5}),
              "a lens of model fisheye has 5 coefficients, expected 4 (k1 k2 k3 k4)");
    EXPECT_EQ(refused(LensModel::none, {1}), "a lens of model none has 1 coefficients, expected 0");
    const Lens lens(LensModel::brown, {0, 0, 0, 0, std::numeric_limits<double>::infinity()});
    EXPECT_EQ(refusal([&] { lens.validate("source"); }),
              "source: lens k3 = inf, expected a finite number");
}

TEST(Lens, CamerasProjectAndUnprojectThroughIt) {
    Pinhole camera{640, 480, 500, 400, 320, 240, 10};
    camera.lens = Lens(LensModel::brown, {-0.2, 0.1, 0.01, 0.02});
    const auto shown = camera.lens.distort({0.5, -0.5});
    const Eigen::Vector2d pixel = project(camera, {1, -1, 2});
    EXPECT_NEAR(pixel.x(), 500 * shown->x() + 10 * shown->y() + 320, 1e-12);
    EXPECT_NEAR(pixel.y(), 400 * shown->y() + 240, 1e-12);
    EXPECT_LT((unproject(camera, pixel.x(), pixel.y(), 2) - Eigen::Vector3d(1, -1, 2)).norm(),
              1e-12);
    camera.lens = Lens(LensModel::brown, {-1.0 / 3, 0, 0, 0});
    EXPECT_TRUE(std::isnan(project(camera, {2, 0, 1}).x()));
    EXPECT_TRUE(std::isnan(unproject(camera, 320 + 0.67 * 500, 240, 1).x()));
}

// Every kernel of rows says the same as `transfer`, for any lenses, corners included.
TEST(Projector, RowsGoThroughBothLenses) {
    std::mt19937 random(4);
    for (int i = 0; i < 60; ++i) {
        const Rig rig = random_bent_rig(random, i, 161, 120, 128, 96);
        const Projector projector(rig);
        std::vector<float> depth(161), u(161), v(161);
        std::vector<std::uint8_t> validity(161);
        SeenRow seen(161);
        for (const int y : {0, 7, 60, 119}) {
            for (float& z : depth) z = static_cast<float>(uniform(random, 0.7, 30));
            map_row(projector, depth.data(), y, 161, u.data(), v.data(), validity.data());
            seen_row(projector, depth.data(), y, 161, seen);
            for (int x = 0; x < 161; ++x) {
                const Eigen::Vector2d expected = transfer(rig, x, y, depth[x]);
                const bool inside = expected.x() >= 0 && expected.x() <= 127 && expected.y() >= 0 &&
                                    expected.y() <= 95;
                if (validity[x] == 0) {
                    EXPECT_NEAR(u[x], expected.x(), 1e-3);
                    EXPECT_NEAR(v[x], expected.y(), 1e-3);
                } else {
                    EXPECT_FALSE(inside) << expected.transpose();
                }
                if (!expected.allFinite()) continue;
                const SeenPoint point = seen_point(rig, x, y, depth[x]);
                const auto near = [&](float a, float b) {
                    EXPECT_NEAR(a, b, 2e-5 * (1 + std::abs(b))) << i << " " << x << " " << y;
                };
                near(seen.ray_x[x], point.ray_x);
                near(seen.ray_y[x], point.ray_y);
                near(seen.rx[x], point.rx);
                near(seen.ry[x], point.ry);
                near(seen.rz[x], point.rz);
                near(seen.x[x], point.x);
                near(seen.y[x], point.y);
                near(seen.inverse_z[x], point.inverse_z);
                near(seen.shown_x[x], point.shown_x);
                near(seen.shown_y[x], point.shown_y);
                near(seen.source.xx[x], point.source.xx);
                near(seen.source.xy[x], point.source.xy);
                near(seen.source.yy[x], point.source.yy);
                near(seen.reference.xx[x], point.reference.xx);
                near(seen.reference.xy[x], point.reference.xy);
                near(seen.reference.yy[x], point.reference.yy);
            }
        }
    }
}

}  // namespace
}  // namespace xcalib

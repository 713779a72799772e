#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "every_target.hpp"
#include "geometry/projector.hpp"
#include "scenes.hpp"
#include "views.hpp"
#include "xcalib/warp.hpp"

namespace xcalib {
namespace {

using namespace ::xcalib::testing;  // NOLINT: scenes.hpp

constexpr std::uint8_t kValid = static_cast<std::uint8_t>(Validity::valid);
constexpr std::uint8_t kOutside = static_cast<std::uint8_t>(Validity::outside);
constexpr std::uint8_t kNoDepth = static_cast<std::uint8_t>(Validity::no_depth);

struct Row {
    std::vector<float> u, v;
    std::vector<std::uint8_t> validity;
};

Row row_of(const Rig& rig, const std::vector<float>& depth, int y) {
    Row row{std::vector<float>(depth.size()), std::vector<float>(depth.size()),
            std::vector<std::uint8_t>(depth.size())};
    map_row(Projector(rig), depth.data(), y, static_cast<int>(depth.size()), row.u.data(),
            row.v.data(), row.validity.data());
    return row;
}

TEST(MapRow, ValidityCodesAreThoseOfTheMasks) {
    EXPECT_EQ(kValid, 0);
    EXPECT_EQ(kOutside, 1);
    EXPECT_EQ(static_cast<int>(Validity::occluded), 2);
    EXPECT_EQ(kNoDepth, 3);
}

TEST(MapRow, ABaselineShiftsByFocalLengthTimesBaselineOverDepth) {
    Rig rig{Pinhole::from_hfov(200, 100, 1.0), Pinhole::from_hfov(200, 100, 1.0), {}};
    rig.source_from_reference.translation = {-0.1, 0, 0};  // the source lies to the right
    std::vector<float> depth(200, 2.0f);
    const Row row = row_of(rig, depth, 40);
    EXPECT_NEAR(row.u[150], 150 - rig.source.fx * 0.1 / 2, 1e-3);
    EXPECT_NEAR(row.v[150], 40, 1e-4);
}

TEST(MapRow, AgreesWithProjectingUnprojectedPointsInDouble) {
    std::mt19937 random(1);
    for (int i = 0; i < 20; ++i) {
        const Rig rig = random_rig(random, 1280, 960, 640, 512);
        std::vector<float> depth(1280);
        for (float& d : depth) d = static_cast<float>(std::exp(uniform(random, -0.7, 5)));
        const int y = static_cast<int>(uniform(random, 0, 960));
        const Row row = row_of(rig, depth, y);
        int valid = 0;
        for (int x = 0; x < 1280; ++x) {
            const Eigen::Vector2d expected = mapped(rig, x, y, depth[x]);
            constexpr double kRim = 2e-3;  // [px] of rounding
            const bool inside = expected.x() > kRim && expected.x() < 639 - kRim &&
                                expected.y() > kRim && expected.y() < 511 - kRim;
            const bool outside = expected.x() < -kRim || expected.x() > 639 + kRim ||
                                 expected.y() < -kRim || expected.y() > 511 + kRim;
            if (inside) {
                ASSERT_EQ(row.validity[x], kValid);
            }
            if (outside) {
                ASSERT_EQ(row.validity[x], kOutside);
            }
            if (row.validity[x] != kValid) continue;
            ++valid;
            ASSERT_NEAR(row.u[x], expected.x(), 1e-3);
            ASSERT_NEAR(row.v[x], expected.y(), 1e-3);
        }
        if (i == 0) {
            EXPECT_GT(valid, 300);
        }
    }
}

TEST(MapRow, IsTheTransferOfEachPointOnEveryTarget) {
    std::mt19937 random(3);
    for (const int width : {1, 15, 16, 17, 333}) {
        const Rig rig = random_rig(random, 640, 480, 320, 256);
        std::vector<float> depth(width);
        for (float& d : depth) d = static_cast<float>(std::exp(uniform(random, -0.7, 5)));
        depth[width / 2] = 0;
        const int y = static_cast<int>(uniform(random, 0, 480));
        on_every_target([&] {
            const Row row = row_of(rig, depth, y);
            SeenRow seen(width);
            seen_row(Projector(rig), depth.data(), y, width, seen);
            for (int x = 0; x < width; ++x) {
                const Eigen::Vector2d expected = transfer(rig, x, y, depth[x]);
                ASSERT_EQ(row.validity[x] == kNoDepth, std::isnan(expected.x())) << x;
                if (row.validity[x] == kValid) {
                    ASSERT_LT((Eigen::Vector2d(row.u[x], row.v[x]) - expected).norm(), 3e-4) << x;
                }
                if (!(depth[x] > 0)) continue;
                const SeenPoint p = seen_point(rig, x, y, depth[x]);
                const float expect[] = {p.ray_x, p.ray_y, p.rx, p.ry, p.rz, p.x, p.y, p.inverse_z};
                const float found[] = {seen.ray_x[x], seen.ray_y[x], seen.rx[x], seen.ry[x],
                                       seen.rz[x],    seen.x[x],     seen.y[x],  seen.inverse_z[x]};
                for (int i = 0; i < 8; ++i)
                    ASSERT_NEAR(found[i], expect[i], 2e-6 * std::max(1.0f, depth[x])) << x << i;
            }
        });
    }
}

TEST(Transfer, IsNowhereWithoutADepthAndBehindTheCamera) {
    Rig rig{Pinhole::from_hfov(101, 81, 1.0), Pinhole::from_hfov(101, 81, 1.0), {}};
    rig.source_from_reference.translation = {0, 0, -5};  // source camera 5 m ahead
    EXPECT_LT((transfer(rig, 50, 40, 6) - Eigen::Vector2d(50, 40)).norm(), 1e-12);
    EXPECT_GT(transfer(rig, 0, 40, 6).x(), -1000);  // far beside its image
    EXPECT_LT(transfer(rig, 0, 40, 6).x(), 0);
    for (const double depth : {5.0, 2.0, 0.0, -6.0, std::nan("")})
        EXPECT_TRUE(transfer(rig, 50, 40, depth).array().isNaN().all()) << depth;
}

TEST(MapRow, WhatIsNotADepthIsNoDepth) {
    const Rig rig{Pinhole::from_hfov(6, 4, 1.0), Pinhole::from_hfov(6, 4, 1.0), {}};
    const Row row = row_of(rig, {0.0f, -1.0f, kNaN, kInfinity, -kInfinity, 1.0f}, 1);
    for (int x = 0; x < 5; ++x) {
        EXPECT_EQ(row.validity[x], kNoDepth) << x;
        EXPECT_TRUE(std::isnan(row.u[x])) << x;
        EXPECT_TRUE(std::isnan(row.v[x])) << x;
    }
    EXPECT_EQ(row.validity[5], kValid);
}

TEST(MapRow, WhatFallsBesideTheSourceIsOutside) {
    const Pinhole camera = Pinhole::from_hfov(100, 80, 1.0);
    for (const Eigen::Vector3d& w : {Eigen::Vector3d(0, 0.3, 0), Eigen::Vector3d(0, -0.3, 0),
                                     Eigen::Vector3d(0.3, 0, 0), Eigen::Vector3d(-0.3, 0, 0)}) {
        const Rig rig = turned({camera, camera, {}}, w);
        int outside = 0;
        for (int y = 0; y < 80; ++y) {
            const Row row = row_of(rig, std::vector<float>(100, 5.0f), y);
            for (int x = 0; x < 100; ++x) {
                const Eigen::Vector2d p = mapped(rig, x, y, 5);
                const bool inside = p.x() >= 0 && p.x() <= 99 && p.y() >= 0 && p.y() <= 79;
                ASSERT_EQ(row.validity[x], inside ? kValid : kOutside) << x << ", " << y;
                ASSERT_EQ(std::isnan(row.u[x]), !inside);
                outside += !inside;
            }
        }
        EXPECT_GT(outside, 800);
    }
}

TEST(MapRow, WhatLiesBehindTheSourceIsOutsideThoughItsMirrorImageIsNot) {
    Rig rig{Pinhole::from_hfov(101, 81, 1.0), Pinhole::from_hfov(101, 81, 1.0), {}};
    rig.source_from_reference.translation = {0, 0, -5};  // source camera 5 m ahead
    std::vector<float> depth(101, 2.0f);
    depth[50] = 5.0f;  // in its plane
    depth[51] = 5.0f + 0.5f * static_cast<float>(kNearestZ);
    depth[52] = 30.0f;
    const Row row = row_of(rig, depth, 40);
    const Eigen::Vector2d mirrored = mapped(rig, 45, 40, 2);
    ASSERT_TRUE(mirrored.x() > 0 && mirrored.x() < 100);  // a projection without the check
    EXPECT_EQ(row.validity[45], kOutside);
    EXPECT_EQ(row.validity[50], kOutside);
    EXPECT_EQ(row.validity[51], kOutside);
    EXPECT_EQ(row.validity[52], kValid);
}

TEST(Warp, IdentityRigReturnsTheImageWhateverTheDepth) {
    std::mt19937 random(2);
    for (const Pinhole& camera :
         {Pinhole::from_hfov(97, 53, 0.8), Pinhole{97, 53, 110.3, 112.9, 47.1, 27.7, 1.3}}) {
        const Rig rig{camera, camera, {}};
        Image image(97, 53), depth(97, 53);
        for (float& value : image.pixels) value = static_cast<float>(uniform(random, 0, 1));
        for (float& d : depth.pixels) d = static_cast<float>(std::exp(uniform(random, -2, 5)));
        const WarpedImage warped = warp(rig, image, depth);
        int invalid = 0;
        double worst = 0;
        for (std::size_t i = 0; i < image.pixels.size(); ++i) {
            invalid += warped.validity[i] != kValid;
            if (warped.validity[i] == kValid)
                worst = std::max(worst, std::abs(double(warped.image.pixels[i]) - image.pixels[i]));
        }
        EXPECT_LT(worst, 1e-4);
        EXPECT_EQ(invalid, 0)
            << "pixels of the outermost rows and columns rounded out of the image";
    }
}

TEST(Warp, SamplesBilinearlyAndZeroWhereNotValid) {
    Rig rig{Pinhole::from_hfov(40, 30, 1.0), Pinhole::from_hfov(40, 30, 1.0), {}};
    rig.source.cx += 2.25;
    rig.source.cy += 1.5;
    const auto ramp = [](double x, double y) { return 0.01 * x + 0.02 * y + 0.001 * x * y; };
    Image depth(40, 30, 3.0f);
    depth.row(5)[5] = 0.0f;
    const WarpedImage warped =
        warp(rig, drawn([](double x, double y) { return 0.01 * x + 0.02 * y; }, 40, 30), depth);
    EXPECT_NEAR(warped.image.row(10)[10], 0.01 * 12.25 + 0.02 * 11.5, 1e-5);
    EXPECT_EQ(warped.image.row(5)[5], 0);
    EXPECT_EQ(warped.validity[5 * 40 + 5], kNoDepth);
    EXPECT_EQ(warped.image.row(10)[39], 0);
    EXPECT_EQ(warped.validity[10 * 40 + 39], kOutside);
    // Within one cell the interpolant is bilinear, not linear: it has the product term.
    Image cell(40, 30);
    cell.row(11)[12] = static_cast<float>(ramp(0, 0));
    cell.row(11)[13] = static_cast<float>(ramp(1, 0));
    cell.row(12)[12] = static_cast<float>(ramp(0, 1));
    cell.row(12)[13] = static_cast<float>(ramp(1, 1));
    EXPECT_NEAR(warp(rig, cell, depth).image.row(10)[10], ramp(0.25, 0.5), 1e-6);
}

}  // namespace
}  // namespace xcalib

#include <gtest/gtest.h>

#include <cmath>

#include "xcalib.h"
#include "xcalib/register.hpp"
#include "xcalib/transfer.hpp"

namespace xcalib {
namespace {

using Eigen::Vector2d;

// A source 0.2 m to the right, of the same kind of camera: disparity is 100 px m / depth to the
// left, so that what is near hides what is to its right.
Rig side_by_side() {
    const Pinhole camera{120, 80, 500, 500, 59.5, 39.5};
    Rig rig{camera, camera, {}};
    rig.source_from_reference.translation = {-0.2, 0, 0};
    return rig;
}

// A wall at 20 m, and a post before it at 5 m in the columns 60 to 79: by 5 and 20 px to the left.
Image post_before_wall() {
    Image depth(120, 80);
    for (int y = 0; y < 80; ++y)
        for (int x = 0; x < 120; ++x) depth.row(y)[x] = x >= 60 && x < 80 ? 5.0f : 20.0f;
    return depth;
}

TEST(Transfer, ByHandAtADepth) {
    const Rig rig = side_by_side();
    const TransferredPoint p = transfer(rig, {70, 30}, 10);
    EXPECT_EQ(p.code, Transferred::valid);
    EXPECT_NEAR((p.point - Vector2d(60, 30)).norm(), 0, 1e-12);
    EXPECT_EQ(transfer(rig, {5, 30}, 10).code, Transferred::outside);
    EXPECT_NEAR(transfer(rig, {5, 30}, 10).point.x(), -5, 1e-12);
    EXPECT_EQ(transfer(rig, {5, 30}, 0).code, Transferred::no_depth);
    EXPECT_EQ(transfer(rig, {5, 30}, NAN).code, Transferred::no_depth);
    EXPECT_NEAR((transfer_back(rig, {60, 30}, 10).point - Vector2d(70, 30)).norm(), 0, 1e-12);
    EXPECT_EQ(transfer_back(rig, {115, 30}, 10).code, Transferred::outside);
}

TEST(Transfer, ThereAndBackOfAnyRig) {
    Rig rig = side_by_side();
    rig.reference.lens = Lens(LensModel::brown, {-0.2, 0.05, 0.001, -0.002});
    rig.source.lens = Lens(LensModel::fisheye, {0.02, -0.01, 0.003, 0});
    rig.source_from_reference.rotation =
        Eigen::AngleAxisd(0.05, Eigen::Vector3d(1, 2, 3).normalized());
    for (const bool mirrored : {false, true}) {
        rig.source_mirrored = mirrored;
        for (const Vector2d& pixel : {Vector2d(20, 10), Vector2d(60.25, 41.5), Vector2d(80, 70)}) {
            const TransferredPoint there = transfer(rig, pixel, 7.5);
            ASSERT_TRUE(there.point.allFinite());
            EXPECT_NEAR((transfer_back(rig, there.point, 7.5).point - pixel).norm(), 0, 1e-8);
        }
    }
}

TEST(Transfer, OfAFrameTellsWhatIsHidden) {
    const Image depth = post_before_wall();
    const FrameTransfer frame(side_by_side(), depth.view());
    EXPECT_EQ(frame.to_source({30.5, 30}).code, Transferred::valid);
    EXPECT_NEAR(frame.to_source({30.5, 30}).point.x(), 25.5, 1e-4);
    EXPECT_NEAR(frame.to_source({70, 30}).point.x(), 50, 1e-4);
    // The post is seen at 40 to 59, the wall behind it, at 45 to 59 there, is not.
    EXPECT_EQ(frame.to_source({55, 30}).code, Transferred::occluded);
    EXPECT_NEAR(frame.to_source({55, 30}).point.x(), 50, 1e-4);
    EXPECT_EQ(frame.to_source({3, 30}).code, Transferred::outside);
    EXPECT_EQ(frame.to_source({-1, 30}).code, Transferred::outside);
    // Back, the post is in front.
    const TransferredPoint front = frame.to_reference({50, 30});
    EXPECT_EQ(front.code, Transferred::valid);
    EXPECT_NEAR((front.point - Vector2d(70, 30)).norm(), 0, 1e-4);
    EXPECT_NEAR(front.depth, 5, 1e-6);
    // To the right of the post the source sees a piece of wall that the post hides from the
    // reference: at 59 to 75.
    EXPECT_EQ(frame.to_reference({68, 30}).code, Transferred::ambiguous);
    // The reference does not reach that far to the right.
    EXPECT_EQ(frame.to_reference({117, 30}).code, Transferred::outside);
    EXPECT_EQ(frame.to_reference({NAN, 30}).code, Transferred::outside);
}

TEST(Transfer, UnknownDepthIsSaid) {
    Image depth(120, 80);
    for (int y = 0; y < 80; ++y)
        for (int x = 0; x < 60; ++x) depth.row(y)[x] = 10;
    const FrameTransfer frame(side_by_side(), depth.view());
    EXPECT_EQ(frame.to_source({90, 30}).code, Transferred::no_depth);
    EXPECT_TRUE(std::isnan(frame.to_source({90, 30}).point.x()));
    EXPECT_EQ(frame.to_reference({90, 30}).code, Transferred::outside);
}

// On a slope, with lenses, the inverse map undoes the registrar's map.
TEST(Transfer, TheInverseMapUndoesTheMap) {
    Rig rig = side_by_side();
    rig.source.lens = Lens(LensModel::brown, {-0.3, 0.1, 0, 0});
    rig.source_from_reference.rotation = Eigen::AngleAxisd(0.04, Eigen::Vector3d::UnitZ());
    Image depth(120, 80);
    for (int y = 0; y < 80; ++y)
        for (int x = 0; x < 120; ++x) depth.row(y)[x] = static_cast<float>(6 + 0.02 * x + 0.03 * y);
    const FrameTransfer frame(rig, depth.view());
    const std::vector<float> back = frame.inverse_map();
    std::vector<float> map(2 * 120 * 80);
    Registrar(rig, {1}).map(depth.view(), map.data());
    int checked = 0;
    for (int y = 2; y < 78; y += 3)
        for (int x = 2; x < 118; x += 3) {
            const float* p = &map[2 * static_cast<std::size_t>(y * 120 + x)];
            if (!std::isfinite(p[0]) || p[0] < 1 || p[0] > 118 || p[1] < 1 || p[1] > 78) continue;
            const TransferredPoint q = frame.to_reference({p[0], p[1]});
            ASSERT_EQ(q.code, Transferred::valid) << x << " " << y;
            EXPECT_NEAR((q.point - Vector2d(x, y)).norm(), 0, 0.01);
            ++checked;
        }
    EXPECT_GT(checked, 500);
    const std::size_t middle = 2 * (40 * 120 + 60);
    const TransferredPoint q = frame.to_reference({60, 40});
    EXPECT_EQ(back[middle], static_cast<float>(q.point.x()));
    EXPECT_EQ(back[middle + 1], static_cast<float>(q.point.y()));
}

TEST(Transfer, DepthOfAnotherAspectIsRefused) {
    const Image depth(100, 80);
    EXPECT_THROW(FrameTransfer(side_by_side(), depth.view()), std::invalid_argument);
}

TEST(Transfer, InC) {
    const Image depth = post_before_wall();
    xcalib_camera camera{120, 80, 500, 500, 59.5, 39.5, 0, XCALIB_LENS_NONE, {}};
    const xcalib_rig rig{camera, camera, {1, 0, 0, 0}, {-0.2, 0, 0}, 0, 0, 0};
    const xcalib_image map{depth.pixels.data(), 120, 80, 1, XCALIB_F32, 480};
    const double points[] = {70, 30, 55, 30, 3, 30};
    double out[6];
    uint8_t codes[3];
    ASSERT_EQ(xcalib_transfer(&rig, &map, points, 3, out, codes), XCALIB_OK);
    EXPECT_NEAR(out[0], 50, 1e-4);
    EXPECT_EQ(codes[0], XCALIB_VALID);
    EXPECT_EQ(codes[1], XCALIB_OCCLUDED);
    EXPECT_EQ(codes[2], XCALIB_OUTSIDE);
    ASSERT_EQ(xcalib_transfer_back(&rig, &map, out, 1, out + 2, codes), XCALIB_OK);
    EXPECT_NEAR(out[2], 70, 1e-3);
    EXPECT_EQ(xcalib_transfer(&rig, nullptr, points, 3, out, codes), XCALIB_INVALID_ARGUMENT);
    EXPECT_STREQ(xcalib_last_error(), "depth is NULL");
}

}  // namespace
}  // namespace xcalib

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include "refusal.hpp"
#include "scenes.hpp"
#include "views.hpp"
#include "xcalib/image.hpp"

namespace xcalib {
namespace {

using ::xcalib::testing::drawn;
using ::xcalib::testing::has;
using ::xcalib::testing::kInfinity;
using ::xcalib::testing::kNaN;
using ::xcalib::testing::refusal;
using ::xcalib::testing::Size;
using ::xcalib::testing::view_of;

// --- Depth
// ----------------------------------------------------------------------------------------

TEST(CleanDepth, WhateverIsNotADepthBecomesZero) {
    const std::vector<float> depth{1.5f, 0.0f, -2.0f, kNaN, kInfinity, -kInfinity, 1e-3f, 80.0f};
    const std::vector<float> expected{1.5f, 0, 0, 0, 0, 0, 1e-3f, 80.0f};
    EXPECT_EQ(clean_depth(view_of(depth, 4, 2)).pixels, expected);
}

TEST(CleanDepth, RowsMayHaveGapsAndOtherTypesAreRefused) {
    const std::vector<float> padded{1, 2, kNaN, 3, 4, kNaN};
    EXPECT_EQ(clean_depth(view_of(padded, 2, 2, 1, 3)).pixels, (std::vector<float>{1, 2, 3, 4}));
    const std::vector<std::uint16_t> words{1, 2, 3, 4};
    EXPECT_TRUE(has(refusal([&] { clean_depth(view_of(words, 2, 2)); }), "float32"));
    const std::vector<float> colour(12, 1.0f);
    EXPECT_TRUE(
        has(refusal([&] { clean_depth(view_of(colour, 2, 2, 3)); }), "one float32 channel"));
}

// From 120 x 90: by whole factors, by others, growing, and not at all.
constexpr Size kSizes[] = {{60, 45},   {30, 22},   {80, 60}, {77, 58},
                           {240, 180}, {149, 112}, {120, 90}};

TEST(ResizeDepth, AConstantStaysWhatItIs) {
    const Image depth(120, 90, 7.25f);
    for (const Size& size : kSizes) {
        const Image out = resize_depth(depth, size.width, size.height);
        ASSERT_EQ(out.width, size.width);
        ASSERT_EQ(out.height, size.height);
        for (const float value : out.pixels) ASSERT_NEAR(value, 7.25, 1e-5);
    }
}

TEST(ResizeDepth, UnknownStaysUnknown) {
    for (const Size& size : kSizes) {
        const Image out = resize_depth(Image(120, 90), size.width, size.height);
        for (const float value : out.pixels) ASSERT_EQ(value, 0);
    }
    // A hole: what lies within it stays unknown, what lies well outside stays known.
    Image depth(120, 90, 5.0f);
    for (int y = 30; y < 60; ++y)
        for (int x = 40; x < 80; ++x) depth.row(y)[x] = 0.0f;
    for (const Size& size : kSizes) {
        const Image out = resize_depth(depth, size.width, size.height);
        const double f = 120.0 / size.width;
        for (int y = 0; y < size.height; ++y)
            for (int x = 0; x < size.width; ++x) {
                const double u = (x + 0.5) * f - 0.5, v = (y + 0.5) * f - 0.5, reach = 0.5 * f + 1;
                const bool inside =
                    u > 39.5 + reach && u < 79.5 - reach && v > 29.5 + reach && v < 59.5 - reach;
                const bool outside =
                    u < 39.5 - reach || u > 79.5 + reach || v < 29.5 - reach || v > 59.5 + reach;
                if (inside) {
                    ASSERT_EQ(out.row(y)[x], 0);
                }
                if (outside) {
                    ASSERT_NEAR(out.row(y)[x], 5, 1e-5);
                }
            }
    }
}

TEST(ResizeDepth, NothingIsInventedBetweenTwoSurfaces) {
    // A slanted edge between 2 m and 20 m, so that every phase of the grid meets it.
    Image depth(120, 90);
    for (int y = 0; y < 90; ++y)
        for (int x = 0; x < 120; ++x) depth.row(y)[x] = x + 0.37 * y < 70 ? 2.0f : 20.0f;
    for (const Size& size : kSizes) {
        const Image out = resize_depth(depth, size.width, size.height);
        int near = 0, far = 0;
        for (const float value : out.pixels) {
            ASSERT_TRUE(std::abs(value - 2) < 1e-4 || std::abs(value - 20) < 1e-3) << value;
            (value < 10 ? near : far)++;
        }
        EXPECT_GT(near, size.width * size.height / 4);
        EXPECT_GT(far, size.width * size.height / 4);
    }
}

// A plane's inverse depth is linear in the pixel.
double plane(double x, double y) { return 0.1 + 4e-4 * x + 8e-4 * y; }

TEST(ResizeDepth, APlaneStaysThatPlane) {
    const Image depth = drawn([](double x, double y) { return 1 / plane(x, y); }, 120, 90);
    for (const Size& size : {Size{60, 45}, Size{30, 22}, Size{240, 180}, Size{149, 112}}) {
        const Image out = resize_depth(depth, size.width, size.height);
        const double fx = 120.0 / size.width, fy = 90.0 / size.height;
        const bool whole = 120 % size.width == 0 && 90 % size.height == 0;
        // Whole factors, and growing, follow the plane; others by up to half a pixel of it.
        const double tolerance = whole || fx < 1 ? 1e-6 : 0.5 * (4e-4 + 8e-4);
        for (int y = 2; y + 2 < size.height; ++y)
            for (int x = 2; x + 2 < size.width; ++x)
                ASSERT_NEAR(1 / out.row(y)[x], plane((x + 0.5) * fx - 0.5, (y + 0.5) * fy - 0.5),
                            tolerance)
                    << size.width << "x" << size.height << " at " << x << ", " << y;
    }
}

TEST(ResizeDepth, StrongReductionsTakeTheWholeAreaToo) {
    // 24 x 24 pixels to one. Within a block the plane stays one surface.
    const auto gentle = [](double x, double y) { return 0.1 + 1e-5 * x + 4e-5 * y; };
    const Image depth = drawn([&](double x, double y) { return 1 / gentle(x, y); }, 240, 192);
    const Image out = resize_depth(depth, 10, 8);
    for (int y = 0; y < 8; ++y)
        for (int x = 0; x < 10; ++x)
            ASSERT_NEAR(1 / out.row(y)[x], gentle(24 * x + 11.5, 24 * y + 11.5), 4e-5)
                << x << ", " << y;
}

// --- Aspect
// ---------------------------------------------------------------------------------------

TEST(RequireSameAspect, AcceptsOneAspectToWithinAPixel) {
    require_same_aspect("depth", 640, 480, 640, 480);
    require_same_aspect("depth", 583, 473, 1166, 946);
    require_same_aspect("depth", 1166, 946, 583, 473);
    require_same_aspect("depth", 213, 160, 640, 480);  // 213.33
    require_same_aspect("depth", 641, 480, 640, 480);
    require_same_aspect("depth", 640, 479, 640, 480);
    require_same_aspect("depth", 60, 46, 640, 480);  // one of the depth's own pixels, large here
}

TEST(RequireSameAspect, AcceptsAPixelOfEitherSize) {
    // 480 x 271 is 1920 x 1080 to within one of its own pixels, whichever of the two is given.
    require_same_aspect("depth", 480, 271, 1920, 1080);
    require_same_aspect("depth", 1920, 1080, 480, 271);
}

TEST(RequireSameAspect, RefusesOthersNamingBothSizes) {
    const std::string message = refusal([] { require_same_aspect("depth", 640, 512, 640, 480); });
    EXPECT_TRUE(has(message, "depth is 640x512"));
    EXPECT_TRUE(has(message, "640x480"));
    EXPECT_NE(refusal([] { require_same_aspect("depth", 480, 640, 640, 480); }), "");
    EXPECT_NE(refusal([] { require_same_aspect("depth", 0, 0, 640, 480); }), "");
    EXPECT_NE(refusal([] { require_same_aspect("depth", 643, 480, 640, 480); }), "");
}

}  // namespace
}  // namespace xcalib

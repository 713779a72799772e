#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "refusal.hpp"
#include "scenes.hpp"
#include "views.hpp"
#include "xcalib/register.hpp"

namespace xcalib {
namespace {

using namespace ::xcalib::testing;  // NOLINT: scenes.hpp, refusal.hpp

template <class T>
struct Pixels {
    int width = 0, height = 0, channels = 1, row = 0;  // values a row
    std::vector<T> values;

    Pixels(int w, int h, int c, int padding = 0)
        : width(w), height(h), channels(c), row(w * c + padding),
          values(static_cast<std::size_t>(row) * h) {}
    T& at(int x, int y, int c) {
        return values[static_cast<std::size_t>(y) * row + x * channels + c];
    }
    T at(int x, int y, int c) const {
        return values[static_cast<std::size_t>(y) * row + x * channels + c];
    }
    static PixelType type() {
        return sizeof(T) == 1 ? PixelType::u8 : sizeof(T) == 2 ? PixelType::u16 : PixelType::f32;
    }
    ImageView view() const {
        return {values.data(), width,  height,
                channels,      type(), static_cast<std::ptrdiff_t>(row * sizeof(T))};
    }
    MutableImageView mutable_view() {
        return {values.data(), width,  height,
                channels,      type(), static_cast<std::ptrdiff_t>(row * sizeof(T))};
    }
};

template <class T>
Pixels<T> random_pixels(std::mt19937& random, int width, int height, int channels,
                        int padding = 0) {
    Pixels<T> pixels(width, height, channels, padding);
    const double top = sizeof(T) == 1 ? 255 : sizeof(T) == 2 ? 65535 : 1;
    for (T& value : pixels.values)
        value =
            static_cast<T>(std::is_floating_point_v<T> ? uniform(random, -2, 3)
                                                       : std::floor(uniform(random, 0, top + 1)));
    return pixels;
}

// Threads; the random depths of these tests hide most of each other.
RegistrarOptions by(int num_threads) { return {num_threads, false, Occlusion::ignore, 0}; }
RegistrarOptions nearest_by(int num_threads) { return {num_threads, true, Occlusion::ignore, 0}; }

constexpr int kFrameWidth = 60, kFrameHeight = 44, kOtherWidth = 50, kOtherHeight = 40;

Rig small_rig(unsigned seed) {
    std::mt19937 random(seed);
    Rig rig = turned(random_rig(random, kFrameWidth, kFrameHeight, kOtherWidth, kOtherHeight),
                     {0.02, 0.15, 0.05});
    rig.source_from_reference.translation.x() = 0.4;
    return rig;
}

Image some_depth(unsigned seed) {
    std::mt19937 random(seed);
    Image depth(kFrameWidth, kFrameHeight);
    for (float& d : depth.pixels) d = static_cast<float>(uniform(random, 1.5, 20));
    depth.row(20)[30] = 0.0f;
    depth.row(20)[31] = kNaN;
    depth.row(20)[32] = -3.0f;
    depth.row(20)[33] = std::numeric_limits<float>::infinity();
    return depth;
}

// Pixel by pixel in double, rounded to the nearest.
template <class T>
void expect_registered_as_by_the_book(int channels) {
    const Rig rig = small_rig(1);
    const Image depth = some_depth(2);
    std::mt19937 random(3);
    const Pixels<T> source =
        random_pixels<T>(random, kOtherWidth, kOtherHeight, channels, /*padding=*/5);
    Pixels<T> out(kFrameWidth, kFrameHeight, channels, /*padding=*/3);
    std::fill(out.values.begin(), out.values.end(), T(77));
    std::vector<std::uint8_t> mask(kFrameWidth * kFrameHeight, 9);
    Registrar(rig, by(2))
        .register_frame(source.view(), depth.view(), out.mutable_view(), mask.data());
    int valid = 0, outside = 0;
    for (int y = 0; y < kFrameHeight; ++y) {
        for (int x = 0; x < kFrameWidth; ++x) {
            const double z = depth.row(y)[x];
            const int code = mask[y * kFrameWidth + x];
            if (!(z > 0) || std::isinf(z)) {
                EXPECT_EQ(code, 3);
            } else {
                const Eigen::Vector2d p = mapped(rig, x, y, z);
                const double rim =
                    std::min({p.x(), kOtherWidth - 1 - p.x(), p.y(), kOtherHeight - 1 - p.y()});
                if (std::abs(rim) > 1e-4) {
                    EXPECT_EQ(code, rim > 0 ? 0 : 1);
                }
                (code == 0 ? valid : outside)++;
            }
            for (int c = 0; c < channels; ++c) {
                if (code != 0) {
                    EXPECT_EQ(out.at(x, y, c), T(0));
                    continue;
                }
                const Eigen::Vector2d p = mapped(rig, x, y, z);
                const int u = std::min(static_cast<int>(p.x()), kOtherWidth - 2);
                const int v = std::min(static_cast<int>(p.y()), kOtherHeight - 2);
                const double a = p.x() - u, b = p.y() - v;
                const double value =
                    (1 - b) * ((1 - a) * source.at(u, v, c) + a * source.at(u + 1, v, c)) +
                    b * ((1 - a) * source.at(u, v + 1, c) + a * source.at(u + 1, v + 1, c));
                if constexpr (std::is_floating_point_v<T>) {
                    EXPECT_NEAR(out.at(x, y, c), value, 1e-3);
                } else {
                    // Half a step for the rounding; the rest is float coordinates.
                    const double slack = sizeof(T) == 1 ? 0.02 : 4.0;
                    EXPECT_NEAR(out.at(x, y, c), value, 0.5 + slack);
                }
            }
        }
        for (int k = kFrameWidth * channels; k < out.row; ++k)
            EXPECT_EQ(out.values[static_cast<std::size_t>(y) * out.row + k], T(77))
                << "wrote into the gap after row " << y;
    }
    EXPECT_GT(valid, kFrameWidth * kFrameHeight / 3);
    EXPECT_GT(outside, 50);
}

TEST(Registrar, KeepsBytesInOneChannel) { expect_registered_as_by_the_book<std::uint8_t>(1); }
TEST(Registrar, KeepsBytesInColour) { expect_registered_as_by_the_book<std::uint8_t>(3); }
TEST(Registrar, Keeps16BitInOneChannel) { expect_registered_as_by_the_book<std::uint16_t>(1); }
TEST(Registrar, Keeps16BitInColour) { expect_registered_as_by_the_book<std::uint16_t>(3); }
TEST(Registrar, KeepsFloatsInOneChannel) { expect_registered_as_by_the_book<float>(1); }
TEST(Registrar, KeepsFloatsInColour) { expect_registered_as_by_the_book<float>(3); }

TEST(Registrar, RefusesASourceOfMorePixelsASideThanItCounts) {
    Rig rig = small_rig(1);
    rig.source.width = 4000001;
    EXPECT_NE(
        refusal([&] { Registrar{rig}; }).find("source is 4000001x40, expected at most 4000000"),
        std::string::npos);
    rig.source.width = 4000000;
    EXPECT_EQ(refusal([&] { Registrar(rig, by(1)); }), "");
}

// A rig that moves by an exact part of a pixel, so that the interpolant is known by hand.
Rig shifted_rig(int width, int height, double dx, double dy) {
    Rig rig{Pinhole::from_hfov(width, height, 1.0), Pinhole::from_hfov(width, height, 1.0), {}};
    rig.source.cx += dx;
    rig.source.cy += dy;
    return rig;
}

TEST(Registrar, RoundsToTheNearestInteger) {
    Pixels<std::uint8_t> source(3, 2, 1);
    source.values = {10, 11, 13, 10, 11, 13};
    Pixels<std::uint8_t> out(3, 2, 1);
    std::vector<std::uint8_t> mask(6);
    const Image depth(3, 2, 1.0f);
    for (const auto& [dx, first, second] :
         {std::tuple{0.25, 10, 12}, {0.75, 11, 13}, {0.375, 10, 12}}) {
        // 10.25 and 11.5; 10.75 and 12.5; 10.375 and 11.75: halves go up
        Registrar(shifted_rig(3, 2, dx, 0))
            .register_frame(source.view(), depth.view(), out.mutable_view(), mask.data());
        EXPECT_EQ(out.at(0, 0, 0), first) << dx;
        EXPECT_NEAR(out.at(1, 0, 0), second, dx == 0.375 ? 0 : 1) << dx;
    }
}

TEST(Registrar, TheFullRangeOfAnIntegerTypeStaysInRange) {
    Pixels<std::uint16_t> source(8, 6, 1), out(8, 6, 1);
    std::fill(source.values.begin(), source.values.end(), 65535);
    std::vector<std::uint8_t> mask(48);
    Registrar(shifted_rig(8, 6, 0.3, 0.6))
        .register_frame(source.view(), Image(8, 6, 3.0f).view(), out.mutable_view(), mask.data());
    for (std::size_t i = 0; i < mask.size(); ++i)
        EXPECT_EQ(out.values[i], mask[i] == 0 ? 65535 : 0);
}

// Every output pixel is one of the source's, the one whose centre is nearest.
template <class T>
void expect_nearest_pixels_as_they_are(int channels) {
    const Rig rig = small_rig(13);
    const Image depth = some_depth(14);
    std::mt19937 random(15);
    const Pixels<T> source =
        random_pixels<T>(random, kOtherWidth, kOtherHeight, channels, /*padding=*/5);
    Pixels<T> out(kFrameWidth, kFrameHeight, channels, /*padding=*/3);
    std::vector<std::uint8_t> mask(kFrameWidth * kFrameHeight, 9), expected_mask(mask);
    Registrar(rig, nearest_by(2))
        .register_frame(source.view(), depth.view(), out.mutable_view(), mask.data());
    Pixels<T> blended(kFrameWidth, kFrameHeight, channels);
    Registrar(rig, by(2))
        .register_frame(source.view(), depth.view(), blended.mutable_view(), expected_mask.data());
    EXPECT_EQ(mask, expected_mask);
    int valid = 0;
    for (int y = 0; y < kFrameHeight; ++y)
        for (int x = 0; x < kFrameWidth; ++x) {
            if (mask[y * kFrameWidth + x] != 0) {
                for (int c = 0; c < channels; ++c) ASSERT_EQ(out.at(x, y, c), T(0));
                continue;
            }
            const Eigen::Vector2d p = mapped(rig, x, y, depth.row(y)[x]);
            // Float coordinates do not decide which side of a border between pixels a point is on.
            const auto to_border = [](double a) { return std::abs(a - std::floor(a) - 0.5); };
            if (std::min(to_border(p.x()), to_border(p.y())) < 1e-3) continue;
            ++valid;
            const int u = static_cast<int>(std::lround(p.x()));
            const int v = static_cast<int>(std::lround(p.y()));
            for (int c = 0; c < channels; ++c)
                ASSERT_EQ(out.at(x, y, c), source.at(u, v, c)) << x << ", " << y;
        }
    EXPECT_GT(valid, kFrameWidth * kFrameHeight / 3);
}

TEST(Registrar, NearestKeepsThePixelsAsTheyAre) {
    expect_nearest_pixels_as_they_are<std::uint8_t>(1);
    expect_nearest_pixels_as_they_are<std::uint8_t>(3);
    expect_nearest_pixels_as_they_are<std::uint16_t>(1);
    expect_nearest_pixels_as_they_are<std::uint16_t>(3);
    expect_nearest_pixels_as_they_are<float>(1);
    expect_nearest_pixels_as_they_are<float>(3);
}

// The far edge of the image is a pixel centre, not the start of a next cell.
TEST(Registrar, NearestReachesTheLastPixel) {
    Pixels<std::uint16_t> source(4, 3, 1), out(4, 3, 1);
    for (int i = 0; i < 12; ++i) source.values[i] = static_cast<std::uint16_t>(1000 + i);
    std::vector<std::uint8_t> mask(12);
    const Registrar registrar(shifted_rig(4, 3, -0.25, -0.25), nearest_by(1));
    registrar.register_frame(source.view(), Image(4, 3, 1.0f).view(), out.mutable_view(),
                             mask.data());
    EXPECT_EQ(out.at(3, 2, 0), 1011);
    EXPECT_EQ(mask[0], 1);
}

template <class T>
void expect_identity_is_exact(int channels) {
    std::mt19937 random(4);
    const Pixels<T> source = random_pixels<T>(random, kFrameWidth, kFrameHeight, channels);
    Pixels<T> out(kFrameWidth, kFrameHeight, channels);
    std::vector<std::uint8_t> mask(kFrameWidth * kFrameHeight, 9);
    const Pinhole camera{kFrameWidth, kFrameHeight, 60.5, 61.25, 30.125, 21.75, 0.5};
    const Image depth(kFrameWidth, kFrameHeight,
                      2.0f);  // a power of two: no rounding of the depth's own
    Registrar(Rig{camera, camera, {}})
        .register_frame(source.view(), depth.view(), out.mutable_view(), mask.data());
    for (int y = 0; y < kFrameHeight; ++y)
        for (int x = 0; x < kFrameWidth; ++x) {
            ASSERT_EQ(mask[y * kFrameWidth + x], 0) << x << ", " << y;
            for (int c = 0; c < channels; ++c) {
                if constexpr (std::is_floating_point_v<T>) {
                    ASSERT_NEAR(out.at(x, y, c), source.at(x, y, c), 1e-4);
                } else {
                    ASSERT_EQ(out.at(x, y, c), source.at(x, y, c)) << x << ", " << y;
                }
            }
        }
}

TEST(Registrar, IdentityReturnsTheImage) {
    expect_identity_is_exact<std::uint8_t>(1);
    expect_identity_is_exact<std::uint8_t>(3);
    expect_identity_is_exact<std::uint16_t>(1);
    expect_identity_is_exact<std::uint16_t>(3);
    expect_identity_is_exact<float>(1);
    expect_identity_is_exact<float>(3);
}

// A pixel that is not finite reaches those that are made of it, and no others.
void expect_not_finite_is_invalid(int channels, bool nearest, float value) {
    std::mt19937 random(8);
    Pixels<float> source = random_pixels<float>(random, kFrameWidth, kFrameHeight, channels);
    const Image depth(kFrameWidth, kFrameHeight, 2.0f);
    RegistrarOptions options = by(2);
    options.nearest = nearest;
    const Registrar registrar(shifted_rig(kFrameWidth, kFrameHeight, 0.25, 0.25), options);
    const auto registered = [&](Pixels<float>& out, std::vector<std::uint8_t>& mask) {
        registrar.register_frame(source.view(), depth.view(), out.mutable_view(), mask.data());
    };
    Pixels<float> before(kFrameWidth, kFrameHeight, channels), after = before;
    std::vector<std::uint8_t> whole(kFrameWidth * kFrameHeight, 9), codes = whole;
    registered(before, whole);
    const int hole_x = 17, hole_y = 11;
    source.values[static_cast<std::size_t>((hole_y * kFrameWidth + hole_x) * channels + channels -
                                           1)] = value;
    registered(after, codes);
    int holes = 0;
    for (int y = 0; y < kFrameHeight; ++y)
        for (int x = 0; x < kFrameWidth; ++x) {
            const bool near =
                nearest ? x == hole_x && y == hole_y
                        : (x == hole_x || x == hole_x - 1) && (y == hole_y || y == hole_y - 1);
            const std::size_t at = static_cast<std::size_t>(y) * kFrameWidth + x;
            holes += near;
            ASSERT_EQ(codes[at], near ? 1 : whole[at]) << x << ", " << y;
            for (int c = 0; c < channels; ++c)
                ASSERT_EQ(after.at(x, y, c), near ? 0.0f : before.at(x, y, c)) << x << ", " << y;
        }
    EXPECT_EQ(holes, nearest ? 1 : 4);
}

TEST(Registrar, WhatIsNotFiniteInTheSourceIsOutside) {
    for (const float value :
         {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
          -std::numeric_limits<float>::infinity()})
        for (const int channels : {1, 3})
            for (const bool nearest : {false, true})
                expect_not_finite_is_invalid(channels, nearest, value);
}

TEST(Registrar, MapIsWhereTheRigSendsEachPixel) {
    const Rig rig = small_rig(5);
    const Image depth = some_depth(6);
    std::vector<float> map(2 * kFrameWidth * kFrameHeight, -7.0f);
    Registrar(rig, by(2)).map(depth.view(), map.data());
    int valid = 0;
    for (int y = 0; y < kFrameHeight; ++y)
        for (int x = 0; x < kFrameWidth; ++x) {
            const float u = map[2 * (y * kFrameWidth + x)], v = map[2 * (y * kFrameWidth + x) + 1];
            ASSERT_EQ(std::isnan(u), std::isnan(v));
            if (std::isnan(u)) continue;
            ++valid;
            const Eigen::Vector2d p = mapped(rig, x, y, depth.row(y)[x]);
            ASSERT_NEAR(u, p.x(), 1e-3);
            ASSERT_NEAR(v, p.y(), 1e-3);
        }
    EXPECT_GT(valid, kFrameWidth * kFrameHeight / 3);
    EXPECT_TRUE(std::isnan(map[2 * (20 * kFrameWidth + 30)]));
}

TEST(Registrar, DepthMayHaveAnotherSize) {
    const Rig rig = small_rig(7);
    const auto plane = [](double x, double y) { return 1 / (0.2 + 2e-3 * x + 4e-3 * y); };
    const Image full = drawn(plane, kFrameWidth, kFrameHeight);
    const Image half = drawn([&](double x, double y) { return plane(2 * x + 0.5, 2 * y + 0.5); },
                             kFrameWidth / 2, kFrameHeight / 2);
    const Image twice = drawn([&](double x, double y) { return plane(x / 2 - 0.25, y / 2 - 0.25); },
                              2 * kFrameWidth, 2 * kFrameHeight);
    const Registrar registrar(rig, by(0));
    std::vector<float> expected(2 * kFrameWidth * kFrameHeight), found(expected.size());
    registrar.map(full.view(), expected.data());
    for (const Image& depth : {half, twice}) {
        registrar.map(depth.view(), found.data());
        int valid = 0;
        for (int y = 1; y < kFrameHeight - 1; ++y)
            for (int x = 1; x < kFrameWidth - 1; ++x) {
                const std::size_t i = 2 * (y * kFrameWidth + x);
                if (std::isnan(expected[i]) || std::isnan(found[i])) continue;
                ++valid;
                ASSERT_NEAR(found[i], expected[i], 2e-3) << x << ", " << y;
                ASSERT_NEAR(found[i + 1], expected[i + 1], 2e-3);
            }
        EXPECT_GT(valid, kFrameWidth * kFrameHeight / 3);
    }
}

TEST(Registrar, TheNumberOfThreadsHasNoSay) {
    const Rig rig = small_rig(8);
    const Image depth = some_depth(9);
    std::mt19937 random(10);
    const Pixels<float> source = random_pixels<float>(random, kOtherWidth, kOtherHeight, 3);
    std::vector<std::vector<float>> images, maps;
    std::vector<std::vector<std::uint8_t>> masks;
    for (const int threads : {1, 2, 3, 0}) {
        const Registrar registrar(rig, by(threads));
        Pixels<float> out(kFrameWidth, kFrameHeight, 3);
        std::vector<std::uint8_t> mask(kFrameWidth * kFrameHeight);
        std::vector<float> map(2 * kFrameWidth * kFrameHeight);
        registrar.register_frame(source.view(), depth.view(), out.mutable_view(), mask.data());
        registrar.map(depth.view(), map.data());
        for (float& value : map)
            if (std::isnan(value)) value = -1;  // to be comparable
        images.push_back(out.values);
        masks.push_back(mask);
        maps.push_back(map);
    }
    for (int i = 1; i < 4; ++i) {
        EXPECT_EQ(images[i], images[0]);
        EXPECT_EQ(masks[i], masks[0]);
        EXPECT_EQ(maps[i], maps[0]);
    }
}

TEST(Registrar, WrongSizesAndTypesAreRefusedNamingBoth) {
    const Registrar registrar(small_rig(11));
    Pixels<std::uint8_t> source(kOtherWidth, kOtherHeight, 1), out(kFrameWidth, kFrameHeight, 1);
    Pixels<std::uint8_t> small(kOtherWidth - 1, kOtherHeight, 1),
        colour(kFrameWidth, kFrameHeight, 3);
    const Image depth(kFrameWidth, kFrameHeight, 3.0f), square(kFrameWidth, kFrameWidth, 3.0f);
    std::vector<std::uint8_t> mask(kFrameWidth * kFrameHeight);
    const auto message = [&](const ImageView& s, const ImageView& d, const MutableImageView& o) {
        return refusal([&] { registrar.register_frame(s, d, o, mask.data()); });
    };
    EXPECT_EQ(message(source.view(), depth.view(), out.mutable_view()), "");
    const std::string wrong_source = message(small.view(), depth.view(), out.mutable_view());
    EXPECT_TRUE(has(wrong_source, "source is 49x40"));
    EXPECT_TRUE(has(wrong_source, "50x40"));
    const std::string wrong_depth = message(source.view(), square.view(), out.mutable_view());
    EXPECT_TRUE(has(wrong_depth, "depth is 60x60"));
    EXPECT_TRUE(has(wrong_depth, "60x44"));
    const std::string wrong_out = message(source.view(), depth.view(), source.mutable_view());
    EXPECT_TRUE(has(wrong_out, "registered is 50x40"));
    EXPECT_TRUE(has(wrong_out, "60x44"));
    EXPECT_NE(message(source.view(), depth.view(), colour.mutable_view()), "");
    EXPECT_NE(message(source.view(), source.view(), out.mutable_view()), "") << "depth in bytes";
    EXPECT_TRUE(has(refusal([&] { registrar.map(square.view(), nullptr); }), "depth is 60x60"));
}

TEST(Registrar, ARigThatIsNotValidIsRefused) {
    Rig rig = small_rig(12);
    rig.source.fx = 0;
    EXPECT_TRUE(has(refusal([&] { Registrar{rig}; }), "source: fx = 0"));
    EXPECT_TRUE(has(refusal([] { Registrar(small_rig(12), by(-1)); }), "num_threads is -1"));
}

}  // namespace
}  // namespace xcalib

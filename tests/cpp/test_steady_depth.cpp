#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "xcalib/depth/steady_depth.hpp"

namespace xcalib {
namespace {

constexpr int kW = 160, kH = 120;

Image texture(double moved = 0) {
    Image image(kW, kH);
    for (int y = 0; y < kH; ++y)
        for (int x = 0; x < kW; ++x) {
            const double at = x - moved;
            image.row(y)[x] = static_cast<float>(0.5 + 0.2 * std::sin(at / 5 + std::sin(y / 9.0)) +
                                                 0.2 * std::cos(y / 6.0 + at / 13));
        }
    return image;
}

Image noisy(float metres, unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<float> noise(0, 0.02f);
    Image depth(kW, kH);
    for (float& value : depth.pixels) value = metres * std::exp(noise(random));
    return depth;
}

// Mean relative error in the middle.
double error(const Image& depth, float metres) {
    double sum = 0;
    int count = 0;
    for (int y = 20; y < kH - 20; ++y)
        for (int x = 30; x < kW - 30; ++x, ++count) sum += std::abs(depth.row(y)[x] / metres - 1);
    return sum / count;
}

TEST(SteadyDepth, AveragesNoiseThatMovesWithTheImage) {
    DepthSteadier steadier;
    Image last;
    for (int i = 0; i < 6; ++i) {
        const Image depth = noisy(10, static_cast<unsigned>(i)), image = texture(2.0 * i);
        last = steadier(i, depth.view(), image.view());
        if (i == 0) {
            for (std::size_t k = 0; k < last.pixels.size(); ++k)
                EXPECT_NEAR(last.pixels[k], depth.pixels[k], 1e-5);
        }
    }
    EXPECT_LT(error(last, 10), 0.65 * error(noisy(10, 5), 10));
}

TEST(SteadyDepth, StartsAnewWhereDepthImageOrOrderChanges) {
    const auto after = [](int index, const Image& depth, const Image& image) {
        DepthSteadier steadier;
        for (int i = 0; i < 4; ++i)
            steadier(i, noisy(10, static_cast<unsigned>(i)).view(), texture().view());
        return steadier(index, depth.view(), image.view());
    };
    const Image depth = noisy(10, 9);
    const auto as_it_is = [](const Image& one, const Image& other, int x, int y) {
        return std::abs(one.row(y)[x] / other.row(y)[x] - 1) < 1e-5;
    };
    // A frame that does not follow.
    const Image other = after(7, depth, texture());
    for (int x = 0; x < kW; ++x) EXPECT_TRUE(as_it_is(other, depth, x, 60)) << x;
    // Something has come; unknown stays unknown.
    Image nearer = depth;
    for (int y = 40; y < 80; ++y)
        for (int x = 60; x < 100; ++x) nearer.row(y)[x] = 4;
    nearer.row(20)[20] = 0;
    const Image found = after(4, nearer, texture());
    for (int x = 64; x < 96; ++x) EXPECT_TRUE(as_it_is(found, nearer, x, 60)) << x;
    EXPECT_EQ(found.row(20)[20], 0.0f);
    EXPECT_FALSE(as_it_is(found, nearer, 20, 60));
    // The picture is another one.
    Image dark = texture();
    for (float& value : dark.pixels) value *= 0.2f;
    const Image unlike = after(4, depth, dark);
    for (int x = 0; x < kW; ++x) EXPECT_TRUE(as_it_is(unlike, depth, x, 60)) << x;
}

TEST(SteadyDepth, DoesNotDependOnThreads) {
    DepthSteadier one, four;
    for (int i = 0; i < 3; ++i) {
        const Image depth = noisy(10, static_cast<unsigned>(i)), image = texture(1.5 * i);
        EXPECT_EQ(one(i, depth.view(), image.view(), 1).pixels,
                  four(i, depth.view(), image.view(), 4).pixels);
    }
}

}  // namespace
}  // namespace xcalib

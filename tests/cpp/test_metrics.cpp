#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "scenes.hpp"
#include "xcalib/judge/metrics.hpp"

namespace xcalib {
namespace {

using namespace ::xcalib::testing;  // NOLINT: scenes.hpp

// tests/test_metrics.py has the comparison with scikit-image and numpy.

Image image_of(int width, int height, std::vector<float> pixels) {
    Image image(width, height);
    image.pixels = std::move(pixels);
    return image;
}

TEST(Metrics, RmseAndPsnrOfNumbersWorkedOutByHand) {
    const Image a = image_of(2, 2, {0, 0, 0, 0}), b = image_of(2, 2, {0.1f, -0.1f, 0.3f, 0.1f});
    EXPECT_NEAR(rmse(a, b, nullptr), std::sqrt(0.12 / 4), 1e-7);
    EXPECT_NEAR(psnr(a, b, nullptr, 1.0), -10 * std::log10(0.03), 1e-5);
    EXPECT_NEAR(psnr(a, b, nullptr, 10.0), 20 - 10 * std::log10(0.03), 1e-5);
    const std::vector<std::uint8_t> valid{1, 255, 0, 1};
    EXPECT_NEAR(rmse(a, b, valid.data()), 0.1, 1e-7);
}

TEST(Metrics, EqualImagesHaveNoErrorAndInfinitePsnr) {
    const Image a = image_of(2, 2, {0, 1, 2, 3});
    EXPECT_EQ(rmse(a, a, nullptr), 0);
    EXPECT_TRUE(std::isinf(psnr(a, a, nullptr, 1.0)));
    EXPECT_GT(psnr(a, a, nullptr, 1.0), 0);
}

TEST(Metrics, NccIsOneUnderGainAndOffsetAndMinusOneReversed) {
    const Image a = image_of(3, 2, {1, 5, 2, 8, 3, 9});
    Image gained = a, reversed = a;
    for (float& v : gained.pixels) v = 3 * v + 100;
    for (float& v : reversed.pixels) v = 4 - v;
    EXPECT_NEAR(ncc(a, gained, nullptr), 1, 1e-9);
    EXPECT_NEAR(ncc(a, reversed, nullptr), -1, 1e-9);
    // (-1, 0, 1) with (1, -2, 1): perpendicular.
    EXPECT_NEAR(ncc(image_of(3, 1, {1, 2, 3}), image_of(3, 1, {1, -2, 1}), nullptr), 0, 1e-12);
}

TEST(Metrics, GcIsOneInAnyContrastPolarity) {
    std::mt19937 random(1);
    const Image a = drawn(blobs(random, 40, 30, 10, 4, 0.9), 40, 30);
    Image reversed = a;
    for (float& v : reversed.pixels) v = 1 - v;
    EXPECT_NEAR(gc(a, a, nullptr), 1, 1e-12);
    EXPECT_NEAR(gc(a, reversed, nullptr), 1, 1e-5);
    const Image b = drawn(blobs(random, 40, 30, 10, 4, 0.9), 40, 30);
    EXPECT_LT(gc(a, b, nullptr), 0.6);
}

TEST(Metrics, SsimIsOneForEqualImagesAndFallsWithNoise) {
    std::mt19937 random(2);
    const Image a = drawn(blobs(random, 40, 30, 10, 4, 0.9), 40, 30);
    Image noisy = a;
    for (float& v : noisy.pixels) v += static_cast<float>(uniform(random, -0.1, 0.1));
    EXPECT_NEAR(ssim(a, a, nullptr, 1.0), 1, 1e-12);
    EXPECT_LT(ssim(a, noisy, nullptr, 1.0), 0.9);
}

TEST(Metrics, WithoutAValidPixelThereIsNoValue) {
    const Image a = image_of(2, 2, {0, 1, 2, 3});
    const std::vector<std::uint8_t> none(4, 0);
    EXPECT_TRUE(std::isnan(rmse(a, a, none.data())));
    EXPECT_TRUE(std::isnan(psnr(a, a, none.data(), 1.0)));
    EXPECT_TRUE(std::isnan(ncc(a, a, none.data())));
    EXPECT_TRUE(std::isnan(gc(a, a, none.data())));
    EXPECT_TRUE(std::isnan(ssim(a, a, nullptr, 1.0))) << "no 11 x 11 window";
}

TEST(PatchResidual, FindsAShiftWithItsSignWhateverTheThreads) {
    std::mt19937 random(3);
    const Field texture = blobs(random, 320, 240, 600, 2.5, 1.1);
    const Image a = drawn(texture, 320, 240);
    // Displaced by (3, -2): what lies at x in the reference lies at x + 3 here. Contrast reversed.
    const Image b = drawn([&](double x, double y) { return 1 - texture(x - 3, y + 2); }, 320, 240);
    const std::vector<PatchShift> one = patch_residual(a, b, nullptr, 1);
    ASSERT_GT(one.size(), 10u);
    for (const PatchShift& shift : one) {
        EXPECT_NEAR(shift.dx, 3, 0.3);
        EXPECT_NEAR(shift.dy, -2, 0.3);
        EXPECT_GE(shift.center_x, 24);
        EXPECT_LE(shift.center_x, 320 - 24);
    }
    for (const int threads : {2, 3}) {
        const std::vector<PatchShift> other = patch_residual(a, b, nullptr, threads);
        ASSERT_EQ(other.size(), one.size());
        for (std::size_t i = 0; i < one.size(); ++i) {
            EXPECT_EQ(other[i].center_x, one[i].center_x);
            EXPECT_EQ(other[i].center_y, one[i].center_y);
            EXPECT_EQ(other[i].dx, one[i].dx);
            EXPECT_EQ(other[i].dy, one[i].dy);
        }
    }
}

TEST(PatchResidual, PatchesWithoutEnoughValidPixelsAreLeftOut) {
    std::mt19937 random(4);
    const Image a = drawn(blobs(random, 320, 240, 600, 2.5, 1.1), 320, 240);
    std::vector<std::uint8_t> valid(320 * 240, 1);
    for (int y = 0; y < 240; ++y)
        for (int x = 0; x < 160; ++x) valid[y * 320 + x] = 0;
    const std::vector<PatchShift> shifts = patch_residual(a, a, valid.data(), 2);
    ASSERT_GT(shifts.size(), 5u);
    for (const PatchShift& shift : shifts) EXPECT_GT(shift.center_x, 160);
    std::fill(valid.begin(), valid.end(), 0);
    EXPECT_TRUE(patch_residual(a, a, valid.data(), 2).empty());
}

}  // namespace
}  // namespace xcalib

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
#include "xcalib/gray.hpp"

namespace xcalib {
namespace {

using ::xcalib::testing::drawn;
using ::xcalib::testing::has;
using ::xcalib::testing::kInfinity;
using ::xcalib::testing::kNaN;
using ::xcalib::testing::refusal;
using ::xcalib::testing::uniform;
using ::xcalib::testing::view_of;

float median_of(Image image) {
    std::nth_element(image.pixels.begin(), image.pixels.begin() + image.pixels.size() / 2,
                     image.pixels.end());
    return image.pixels[image.pixels.size() / 2];
}

double mean_of(const Image& image) {
    return std::accumulate(image.pixels.begin(), image.pixels.end(), 0.0) /
           static_cast<double>(image.pixels.size());
}

// --- to_gray
// --------------------------------------------------------------------------------------

TEST(ToGray, IntegersSpanZeroToOneOfTheirOwnRange) {
    const std::vector<std::uint8_t> bytes{0, 51, 255};
    const Image from_bytes = to_gray(view_of(bytes, 3, 1));
    EXPECT_EQ(from_bytes.pixels[0], 0);
    EXPECT_NEAR(from_bytes.pixels[1], 0.2, 1e-6);
    EXPECT_NEAR(from_bytes.pixels[2], 1, 1e-6);
    const std::vector<std::uint16_t> words{0, 13107, 65535};
    const Image from_words = to_gray(view_of(words, 3, 1));
    EXPECT_EQ(from_words.pixels[0], 0);
    EXPECT_NEAR(from_words.pixels[1], 0.2, 1e-6);
    EXPECT_NEAR(from_words.pixels[2], 1, 1e-6);
}

TEST(ToGray, FloatsStayAsTheyAre) {
    const std::vector<float> pixels{-3.5f, 0.25f, 7000.0f, 1e-20f};
    EXPECT_EQ(to_gray(view_of(pixels, 2, 2)).pixels, pixels);
}

TEST(ToGray, ColourIsBlueGreenRedLuma) {
    const std::vector<std::uint8_t> bytes{255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255};
    const Image gray = to_gray(view_of(bytes, 4, 1, 3));
    EXPECT_NEAR(gray.pixels[0], 0.114, 1e-6);
    EXPECT_NEAR(gray.pixels[1], 0.587, 1e-6);
    EXPECT_NEAR(gray.pixels[2], 0.299, 1e-6);
    EXPECT_NEAR(gray.pixels[3], 1.0, 1e-6);
    const std::vector<std::uint16_t> words{65535, 0, 0, 0, 65535, 0};
    EXPECT_NEAR(to_gray(view_of(words, 2, 1, 3)).pixels[1], 0.587, 1e-6);
    const std::vector<float> floats{1, 2, 3};
    EXPECT_NEAR(to_gray(view_of(floats, 1, 1, 3)).pixels[0], 0.114 + 2 * 0.587 + 3 * 0.299, 1e-6);
}

template <class T>
void expect_padding_is_skipped(int channels) {
    constexpr int kWidth = 5, kHeight = 4, kPadding = 7;
    const int row = kWidth * channels + kPadding;
    std::vector<T> dense, padded(static_cast<std::size_t>(row) * kHeight, T(99));
    for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth * channels; ++x) {
            const T value = static_cast<T>((7 * y + 3 * x) % 50);
            dense.push_back(value);
            padded[static_cast<std::size_t>(y) * row + x] = value;
        }
    EXPECT_EQ(to_gray(view_of(padded, kWidth, kHeight, channels, row)).pixels,
              to_gray(view_of(dense, kWidth, kHeight, channels)).pixels);
}

TEST(ToGray, RowsMayHaveGapsBetweenThem) {
    for (const int channels : {1, 3}) {
        expect_padding_is_skipped<std::uint8_t>(channels);
        expect_padding_is_skipped<std::uint16_t>(channels);
        expect_padding_is_skipped<float>(channels);
    }
}

TEST(ToGray, RowsMayRunUpwards) {
    const std::vector<std::uint8_t> bytes{255, 255, 0, 0};
    const ImageView flipped{bytes.data() + 2, 2, 2, 1, PixelType::u8, -2};
    const Image gray = to_gray(flipped);
    EXPECT_EQ(gray.pixels[0], 0);
    EXPECT_NEAR(gray.pixels[2], 1, 1e-6);
}

TEST(ToGray, APixelThatIsNotFiniteIsRefusedWithItsPlace) {
    std::vector<float> pixels(12, 0.5f);
    pixels[6] = kNaN;  // x = 2, y = 1 of 4 x 3
    const std::string message = refusal([&] { to_gray(view_of(pixels, 4, 3)); });
    EXPECT_TRUE(has(message, "nan"));
    EXPECT_TRUE(has(message, "x = 2, y = 1"));
    pixels[6] = -kInfinity;
    EXPECT_TRUE(has(refusal([&] { to_gray(view_of(pixels, 4, 3)); }), "-inf"));
    std::vector<float> colour(3 * 12, 0.5f);
    colour[3 * 11 + 2] = kNaN;
    EXPECT_TRUE(has(refusal([&] { to_gray(view_of(colour, 4, 3, 3)); }), "x = 3, y = 2"));
}

TEST(ToGray, OtherNumbersOfChannelsAreRefused) {
    const std::vector<std::uint8_t> bytes(16, 0);
    EXPECT_TRUE(has(refusal([&] { to_gray(view_of(bytes, 2, 2, 4)); }), "4 channels"));
    EXPECT_TRUE(has(refusal([&] { to_gray(view_of(bytes, 2, 2, 2)); }), "2 channels"));
}

// --- Normalization
// --------------------------------------------------------------------------------

TEST(NormalizePercentiles, Takes1stTo99thPercentileToZeroToOne) {
    Image counts(100, 10);  // raw thermal: 7000..7999
    std::iota(counts.pixels.begin(), counts.pixels.end(), 7000.0f);
    const Image out = normalize_percentiles(counts);
    EXPECT_NEAR(out.pixels[10], 0, 2e-3);
    EXPECT_NEAR(out.pixels[989], 1, 2e-3);
    EXPECT_NEAR(out.pixels[500], 0.5, 2e-3);
    EXPECT_EQ(out.pixels[0], 0);    // below is clipped
    EXPECT_EQ(out.pixels[999], 1);  // and above
}

TEST(NormalizePercentiles, AFewHotPixelsHaveNoSay) {
    std::mt19937 random(1);
    Image image(60, 50);
    for (float& value : image.pixels) value = static_cast<float>(uniform(random, 0.4, 0.5));
    image.pixels[7] = 1000.0f;
    image.pixels[8] = -1000.0f;
    const Image out = normalize_percentiles(image);
    EXPECT_NEAR(median_of(out), 0.5, 0.05);
}

TEST(NormalizePercentiles, OneDifferentPixelIsEnough) {
    Image image(40, 40, 3.0f);
    image.pixels[55] = 4.0f;
    const Image out = normalize_percentiles(image);
    EXPECT_EQ(out.pixels[55], 1);
    EXPECT_EQ(out.pixels[0], 0);
}

TEST(NormalizePercentiles, AConstantImageIsRefusedWithItsValue) {
    const std::string message = refusal([] { normalize_percentiles(Image(40, 40, 0.25f)); });
    EXPECT_TRUE(has(message, "constant"));
    EXPECT_TRUE(has(message, "0.25"));
    EXPECT_TRUE(has(refusal([] { normalize_dark(Image(40, 40, 0.0f)); }), "constant"));
}

// A night image: most of it in the lowest few per cent, a few lamps.
Image night_image() {
    std::mt19937 random(2);
    Image image(80, 60);
    for (float& value : image.pixels)
        value = static_cast<float>(0.3 * std::pow(uniform(random, 0, 1), 2));
    for (int i = 0; i < 100; ++i) image.pixels[random() % image.pixels.size()] = 1.0f;
    return image;
}

TEST(NormalizeDark, TakesTheMedianOfANightImageToTwoFifths) {
    EXPECT_LT(median_of(normalize_percentiles(night_image())), 0.1);
    EXPECT_NEAR(median_of(normalize_dark(night_image())), 0.4, 0.01);
}

TEST(NormalizeDark, KeepsTheOrderOfValuesAndZeroToOne) {
    const Image before = normalize_percentiles(night_image()),
                after = normalize_dark(night_image());
    for (std::size_t i = 0; i < before.pixels.size(); ++i)
        for (std::size_t k = i + 1; k < before.pixels.size(); k += 97) {
            if (before.pixels[i] < before.pixels[k]) {
                EXPECT_LT(after.pixels[i], after.pixels[k]);
            }
            if (before.pixels[i] == before.pixels[k]) {
                EXPECT_EQ(after.pixels[i], after.pixels[k]);
            }
        }
    const auto [low, high] = std::minmax_element(after.pixels.begin(), after.pixels.end());
    EXPECT_EQ(*low, 0);
    EXPECT_NEAR(*high, 1, 1e-6);
}

TEST(NormalizeDark, LeavesADayImageAlone) {
    std::mt19937 random(3);
    Image image(80, 60);
    for (float& value : image.pixels) value = static_cast<float>(uniform(random, 0, 1));
    EXPECT_EQ(normalize_dark(image).pixels, normalize_percentiles(image).pixels);
}

// --- Resizing
// -------------------------------------------------------------------------------------

TEST(ResizeArea, IsTheMeanOfTheAreaThatAPixelCovers) {
    std::mt19937 random(4);
    Image image(12, 6);
    for (float& value : image.pixels) value = static_cast<float>(uniform(random, 0, 1));
    const Image small = resize_area(image, 4, 3);
    for (int y = 0; y < 3; ++y)
        for (int x = 0; x < 4; ++x) {
            double sum = 0;
            for (int dy = 0; dy < 2; ++dy)
                for (int dx = 0; dx < 3; ++dx) sum += image.row(2 * y + dy)[3 * x + dx];
            EXPECT_NEAR(small.row(y)[x], sum / 6, 1e-6);
        }
}

TEST(ResizeArea, WeighsPixelsByTheirShareOfTheArea) {
    Image image(3, 2);
    image.pixels = {1, 2, 4, 1, 2, 4};
    const Image small = resize_area(image, 2, 2);  // each covers one and a half
    EXPECT_NEAR(small.row(0)[0], (1 + 0.5 * 2) / 1.5, 1e-6);
    EXPECT_NEAR(small.row(0)[1], (0.5 * 2 + 4) / 1.5, 1e-6);
}

TEST(ResizeArea, KeepsTheMeanAtOddSizes) {
    std::mt19937 random(5);
    Image image(73, 51);
    for (float& value : image.pixels) value = static_cast<float>(uniform(random, 0, 1));
    EXPECT_NEAR(mean_of(resize_area(image, 31, 20)), mean_of(image), 1e-5);
}

TEST(ResizeArea, FollowsTheConventionOfTheCameras) {
    // A ramp is x; at another size its value is the old coordinate of the new pixel.
    const auto ramp = [](double x, double y) { return x + 2 * y; };
    const Image image = drawn(ramp, 64, 48);
    for (const double f : {0.5, 0.25, 2.0}) {
        const Image out = resize_area(image, static_cast<int>(64 * f), static_cast<int>(48 * f));
        const int x = out.width / 3, y = out.height / 2;
        EXPECT_NEAR(out.row(y)[x], ramp((x + 0.5) / f - 0.5, (y + 0.5) / f - 0.5), 1e-4);
    }
}

TEST(KnownGray, FillsWhatIsNotFiniteFromAround) {
    Image slope(20, 10);
    for (int y = 0; y < 10; ++y)
        for (int x = 0; x < 20; ++x) slope.row(y)[x] = static_cast<float>(x);
    EXPECT_EQ(known_gray(slope.view()).pixels, slope.pixels);
    Image holed = slope;
    for (const auto& [x, y] : {std::pair{5, 5}, {6, 5}, {7, 5}, {0, 0}, {19, 9}})
        holed.row(y)[x] = x == 6 ? kInfinity : kNaN;
    const Image filled = known_gray(holed.view());
    for (int y = 0; y < 10; ++y)
        for (int x = 0; x < 20; ++x) EXPECT_NEAR(filled.row(y)[x], x, 1.0) << x << ", " << y;
    // All of a hole, however large.
    Image left(20, 10, 2.0f);
    for (int y = 0; y < 10; ++y) std::fill_n(left.row(y) + 10, 10, kNaN);
    EXPECT_EQ(known_gray(left.view()).pixels, Image(20, 10, 2.0f).pixels);
}

TEST(KnownGray, RefusesWhatIsHardlyKnown) {
    Image image(4, 4, 1.0f);
    std::fill_n(image.pixels.begin(), 9, kNaN);
    EXPECT_EQ(refusal([&] { known_gray(image.view()); }),
              "image has 9 of 16 pixels that are not finite, expected at most half of them");
}

TEST(GaussianBlur, SpreadsAPointByItsSigmaAndKeepsTheSum) {
    Image image(41, 41);
    image.row(20)[20] = 1.0f;
    const Image out = gaussian_blur(image, 1.5);
    double sum = 0, moment = 0;
    for (int y = 0; y < 41; ++y)
        for (int x = 0; x < 41; ++x) {
            sum += out.row(y)[x];
            moment += out.row(y)[x] * (x - 20) * (x - 20);
        }
    EXPECT_NEAR(sum, 1, 1e-5);
    EXPECT_NEAR(moment, 1.5 * 1.5, 0.05);
    EXPECT_EQ(gaussian_blur(image, 0).pixels, image.pixels);
}

TEST(GaussianBlur, LeavesAConstantImageConstantUpToTheBorder) {
    const Image out = gaussian_blur(Image(20, 10, 0.75f), 0.8);
    for (const float value : out.pixels) EXPECT_NEAR(value, 0.75, 1e-6);
}

}  // namespace
}  // namespace xcalib

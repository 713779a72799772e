#include <gtest/gtest.h>

#include <cmath>

#include "refusal.hpp"
#include "views.hpp"
#include "xcalib/footage/clock_offset.hpp"

namespace xcalib {
namespace {

using testing::has;
using testing::refusal;

// A field of blobs that wanders by no rule; `late`: what the clock says of the scene's time.
struct Camera {
    std::vector<double> times;
    double late = 0.0;

    Camera(int count, double period, double late_by) : late(late_by) {
        for (int i = 0; i < count; ++i) times.push_back(i * period + late);
    }
    static double place(double time) {
        return 25 * std::sin(1.7 * time) + 14 * std::sin(4.1 * time + 1) +
               8 * std::sin(9.7 * time + 2);
    }
    std::vector<std::uint8_t> image(int index, bool inverted) const {
        const double moved = place(times[static_cast<std::size_t>(index)] - late);
        std::vector<std::uint8_t> pixels(200 * 120);
        for (int y = 0; y < 120; ++y)
            for (int x = 0; x < 200; ++x) {
                const double at = x + moved;
                const double value =
                    110 + 60 * std::sin(at / 6 + std::sin(y / 11.0)) * std::cos(y / 7.0 + at / 17);
                pixels[static_cast<std::size_t>(200 * y + x)] =
                    static_cast<std::uint8_t>(inverted ? 255 - value : value);
            }
        return pixels;
    }
    EdgesOfFrame edges(bool inverted, int lost = -1) const {
        return [this, inverted, lost](int index) -> std::optional<Image> {
            if (index == lost) return std::nullopt;
            return motion_edges(testing::view_of(image(index, inverted), 200, 120));
        };
    }
};

TEST(ClockOffset, IsFoundToAFractionOfAFrame) {
    const Camera visible(150, 1.0 / 30, 0.0);
    for (const double late : {0.31, -0.17, 0.0}) {
        const Camera thermal(150, 1.0 / 30, late);
        const OffsetEstimate found = estimate_offset(visible.times, thermal.times,
                                                     visible.edges(false), thermal.edges(true, 40));
        EXPECT_TRUE(found.trusted) << found.line();
        EXPECT_NEAR(found.offset, late, 0.01);
        EXPECT_TRUE(has(found.line(), "source late by "));
    }
}

TEST(ClockOffset, WhatStandsStillTellsNothing) {
    const Camera camera(40, 0.1, 0.0);
    const Image still = motion_edges(testing::view_of(camera.image(0, false), 200, 120));
    const auto edges = [&](int) { return std::optional(still); };
    const OffsetEstimate found = estimate_offset(camera.times, camera.times, edges, edges);
    EXPECT_FALSE(found.trusted);
    EXPECT_EQ(found.offset, 0.0);
    // Too few to tell, and times that have nothing in common.
    const std::vector<double> few{0, 1, 2};
    EXPECT_FALSE(estimate_offset(few, few, edges, edges).trusted);
    EXPECT_TRUE(has(refusal([&] {
                        estimate_offset(few, {1000.0, 1001.0}, edges, edges);
                    }),
                    "source times 1000.000 to 1001.000 s are more than 2 s from"));
}

TEST(ClockOffset, EdgesHaveOneScaleWhateverTheGain) {
    const Camera camera(1, 0.1, 0.0);
    const std::vector<std::uint8_t> pixels = camera.image(0, false);
    std::vector<float> weak(pixels.begin(), pixels.end());
    for (float& value : weak) value *= 1e-3f;
    const Image one = motion_edges(testing::view_of(pixels, 200, 120));
    const Image other = motion_edges(testing::view_of(weak, 200, 120));
    ASSERT_EQ(one.pixels.size(), other.pixels.size());
    EXPECT_EQ(one.width, 160);
    for (std::size_t i = 0; i < one.pixels.size(); ++i)
        EXPECT_NEAR(one.pixels[i], other.pixels[i], 1e-3);
    weak[500] = testing::kNaN;
    for (const float value : motion_edges(testing::view_of(weak, 200, 120)).pixels)
        EXPECT_TRUE(std::isfinite(value));
}

TEST(ClockOffset, RegistrationChoosesAmongCandidates) {
    std::vector<double> times;
    for (int i = 0; i < 40; ++i) times.push_back(0.1 * i);
    // Frames register best with the partner three frames later, each a bit differently.
    const auto score = [](int reference, int source) -> std::optional<double> {
        if (reference == 17) return std::nullopt;  // cannot be decoded
        return 0.7 - 0.05 * std::abs(source - reference - 3) + 0.001 * (reference % 5);
    };
    const std::vector<double> candidates = offsets_around(0.1, times, times);
    EXPECT_EQ(candidates.size(), 49u);
    EXPECT_NEAR(candidates.front(), 0.1 - 0.6, 1e-12);
    const RefinedOffset found = refine_offset(times, times, candidates, score);
    EXPECT_TRUE(found.decided) << found.line();
    EXPECT_NEAR(found.offset, 0.3, 0.051);
    const RefinedOffset flat =
        refine_offset(times, times, candidates, [](int, int) { return std::optional(0.5); });
    EXPECT_FALSE(flat.decided);
    EXPECT_DOUBLE_EQ(flat.offset, candidates[24]);
    EXPECT_TRUE(has(flat.line(), "change too little"));
    const RefinedOffset none =
        refine_offset(times, times, candidates, [](int, int) { return std::nullopt; });
    EXPECT_TRUE(none.scores.empty());
    EXPECT_TRUE(has(none.line(), "too few frames"));
    EXPECT_TRUE(has(refusal([&] { refine_offset(times, times, {}, score); }), "no candidate"));
}

TEST(ClockOffset, ARegisteredPairIsJudgedByItsEdges) {
    const Camera camera(30, 1.0 / 30, 0.0);
    Rig rig;
    rig.reference = rig.source = {200, 120, 180, 180, 99.5, 59.5};
    const std::vector<std::uint8_t> reference = camera.image(0, false),
                                    source = camera.image(0, true), later = camera.image(20, true);
    const Image depth(200, 120, 10.0f), unknown(200, 120, 0.0f);
    RegisteredNec judge(rig);
    const auto judged = [&](const std::vector<std::uint8_t>& image, const Image& metres) {
        return judge(testing::view_of(reference, 200, 120), testing::view_of(image, 200, 120),
                     metres.view());
    };
    EXPECT_GT(judged(source, depth), 0.99);
    EXPECT_LT(judged(later, depth), 0.9);
    EXPECT_EQ(judged(source, unknown), 0.0);
}

}  // namespace
}  // namespace xcalib

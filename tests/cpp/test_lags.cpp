#include <gtest/gtest.h>

#include "refusal.hpp"
#include "scenes.hpp"
#include "xcalib/footage/lags.hpp"

namespace xcalib {
namespace {

using testing::has;
using testing::refusal;

constexpr int kFrames = 18, kLateWidth = 160, kLateHeight = 120;

// A rig before a scene that moves by `steps` from frame to frame, sources a little noisy.
struct Drive {
    Rig truth;
    std::vector<Image> references, sources, depths;

    Drive(unsigned seed, const std::function<Eigen::Vector2d(int)>& place, bool mirrored = false) {
        std::mt19937 random(seed);
        truth = testing::random_rig(random, kLateWidth, kLateHeight, kLateWidth, kLateHeight);
        const testing::Field scene = testing::blobs(random, kLateWidth, kLateHeight, 60, 3, 1.3);
        const testing::Field depth = testing::rolling_depth(kLateWidth, kLateHeight);
        for (int i = 0; i < kFrames; ++i) {
            const Eigen::Vector2d at = place(i);
            const testing::Field now = [&](double x, double y) {
                return scene(x - at.x(), y - at.y());
            };
            references.push_back(testing::drawn(now, kLateWidth, kLateHeight));
            sources.push_back(testing::source_view(
                truth, [&](double x, double y) { return 1 - now(x, y); }, depth));
            for (float& value : sources.back().pixels)
                value += static_cast<float>(testing::uniform(random, -0.01, 0.01));
            if (mirrored)
                for (int y = 0; y < kLateHeight; ++y)
                    std::reverse(sources.back().row(y), sources.back().row(y) + kLateWidth);
            depths.push_back(testing::drawn(depth, kLateWidth, kLateHeight));
        }
        if (mirrored) truth = with_flipped_source(truth);
    }

    // With the source `late` frames late in what is called its own; from the middle on `later`.
    LagReport report(int late) const { return report(late, late); }
    LagReport report(int before, int later) const {
        std::vector<ImageView> reference_views, depth_views;
        std::vector<SourcesAtLag> lags;
        for (int lag = -kMaxLag; lag <= kMaxLag; ++lag) lags.push_back({lag, {}});
        for (int i = kMaxLag; i + kMaxLag < kFrames; ++i) {
            const auto at = static_cast<std::size_t>(i);
            reference_views.push_back(references[at].view());
            depth_views.push_back(depths[at].view());
            for (SourcesAtLag& lag : lags) {
                const int source = i + lag.lag - (2 * i < kFrames ? before : later);
                lag.sources.push_back(source < 0 || source >= kFrames
                                          ? ImageView{}
                                          : sources[static_cast<std::size_t>(source)].view());
            }
        }
        CalibrationOptions options;
        options.num_threads = 2;
        return fit_lags(reference_views, depth_views, lags, truth, options);
    }
};

// Whole and half pixels without a rule.
Eigen::Vector2d wandering(int i) {
    return {3 * std::sin(1.3 * i) + 2 * std::sin(3.1 * i), 2 * std::sin(2.2 * i + 1)};
}

TEST(Lags, AreFoundWhereMotionIsUneven) {
    const Drive drive(3, wandering);
    for (const int late : {-1, 0, 2}) {
        const LagReport found = drive.report(late);
        EXPECT_EQ(found.frames, late) << found.line();
        EXPECT_GE(found.fits.size(), 3u);  // and further only where there is hope
        EXPECT_EQ(found.at(0).gain, 0.0);
        if (late != 0) {
            EXPECT_GT(found.at(late).gain, 4 * found.at(late).error);
            EXPECT_TRUE(has(found.line(), late < 0 ? "1 frame early" : "2 frames late"));
        }
    }
}

TEST(Lags, AreNotFoundWhereNothingMoves) {
    const LagReport found = Drive(4, [](int) { return Eigen::Vector2d(0, 0); }).report(1);
    EXPECT_EQ(found.frames, 0) << found.line();
    EXPECT_TRUE(has(found.line(), "no lag fits better"));
}

TEST(Lags, ThatChangeAreSaidToChange) {
    const Drive drive(6, wandering);
    for (const int change : {-1, 1}) {
        const LagReport found = drive.report(0, change);
        EXPECT_EQ(found.change, change) << found.line();
        EXPECT_EQ(found.frames, 0);
        EXPECT_TRUE(has(found.line(), "between the halves of the footage"));
    }
    EXPECT_EQ(drive.report(1).change, 0);
}

TEST(Lags, OfMirroredSourcesAreFoundToo) {
    const Drive drive(5, wandering, true);
    ASSERT_TRUE(drive.truth.source_mirrored);
    const LagReport found = drive.report(1);
    EXPECT_EQ(found.frames, 1) << found.line();
    EXPECT_TRUE(found.at(1).rig.source_mirrored);
}

TEST(Lags, WhatIsNotThereIsNotLookedAt) {
    const Image image(64, 48, 0.5f);
    const std::vector<ImageView> views(8, image.view());
    Rig rig;
    rig.reference = rig.source = Pinhole::from_hfov(64, 48, 0.8);
    EXPECT_TRUE(has(refusal([&] {
                        fit_lags(views, views, {{1, views}}, rig, {});
                    }),
                    "there is no lag 0"));
    EXPECT_TRUE(has(refusal([&] {
                        fit_lags(views, views, {{0, views}, {0, views}}, rig, {});
                    }),
                    "lags do not rise"));
    EXPECT_TRUE(has(refusal([&] {
                        fit_lags(views, views, {{0, {views[0]}}}, rig, {});
                    }),
                    "1 sources"));
    const Image small(32, 48, 0.5f);
    std::vector<ImageView> others = views;
    others[3] = small.view();
    EXPECT_TRUE(has(refusal([&] {
                        fit_lags(views, views, {{0, views}, {1, others}}, rig, {});
                    }),
                    "a source at lag 1 is 32x48, expected 64x48"));
}

}  // namespace
}  // namespace xcalib

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "refusal.hpp"
#include "scenes.hpp"
#include "xcalib/flow.hpp"

namespace xcalib {
namespace {

using namespace ::xcalib::testing;  // NOLINT: scenes.hpp

constexpr int kWidth = 320, kHeight = 240;

// Waves of all directions, 8 to 25 px long: it repeats nowhere.
Field texture_of(unsigned seed) {
    std::mt19937 random(seed);
    struct Wave {
        double kx, ky, phase;
    };
    std::vector<Wave> waves;
    for (int i = 0; i < 40; ++i) {
        const double k = 6.28 / uniform(random, 8, 25), direction = uniform(random, 0, 6.28);
        waves.push_back(
            {k * std::cos(direction), k * std::sin(direction), uniform(random, 0, 6.28)});
    }
    return [waves](double x, double y) {
        double value = 0.5;
        for (const Wave& w : waves) value += 0.04 * std::sin(w.kx * x + w.ky * y + w.phase);
        return value;
    };
}

// The other modality: contrast folded over, so that neither sign nor order of brightness is kept.
Image seen_otherwise(const Field& texture, const Field& dx, const Field& dy) {
    return drawn(
        [&](double x, double y) {
            const double value = texture(x - dx(x, y), y - dy(x, y));
            return 0.8 - 0.5 * value + 0.1 * std::sin(6 * value);
        },
        kWidth, kHeight);
}

Field constant(double value) {
    return [value](double, double) { return value; };
}

struct Confident {
    double share = 0;    // of all vectors
    double right = 0;    // of those, the share within 0.5 px of what `expected` says
    double largest = 0;  // error [px]
};

Confident judge(const FlowField& flow, const Field& dx, const Field& dy) {
    int known = 0, right = 0;
    Confident out;
    for (int row = 0; row < flow.height; ++row)
        for (int column = 0; column < flow.width; ++column) {
            const int i = row * flow.width + column;
            if (flow.confidence[i] < 0.5) continue;
            ++known;
            const double x = column * flow.step + flow.step / 2;
            const double y = row * flow.step + flow.step / 2;
            const double error = std::hypot(flow.x[i] - dx(x, y), flow.y[i] - dy(x, y));
            right += error < 0.5;
            out.largest = std::max(out.largest, error);
        }
    out.share = static_cast<double>(known) / static_cast<double>(flow.x.size());
    out.right = known > 0 ? static_cast<double>(right) / known : 0;
    return out;
}

TEST(PatchFlow, FindsAShiftWithItsSign) {
    const Field texture = texture_of(1);
    const Image reference = drawn(texture, kWidth, kHeight);
    for (const auto& [dx, dy] : {std::pair{0.0, 0.0}, {1.3, -0.6}, {-5.5, 3.2}, {12.0, 9.0}}) {
        // What lies at p in the reference lies at p + (dx, dy) here.
        const Image other = seen_otherwise(texture, constant(dx), constant(dy));
        const FlowField flow = patch_flow(reference, other, nullptr);
        const Confident found = judge(flow, constant(dx), constant(dy));
        EXPECT_GT(found.share, 0.7) << dx << ", " << dy;
        EXPECT_GT(found.right, 0.97) << dx << ", " << dy;
    }
}

TEST(PatchFlow, FollowsAFieldThatVaries) {
    const Field texture = texture_of(2);
    // 6 px one way on the left, 6 px the other way on the right.
    const Field dx = [](double x, double) { return 12 * (x / kWidth - 0.5); };
    const Field dy = [](double, double y) { return 3 * std::sin(6.28 * y / kHeight); };
    const Image other = seen_otherwise(texture, dx, dy);
    const FlowField flow = patch_flow(drawn(texture, kWidth, kHeight), other, nullptr);
    // The displacement is given where it leads to; over its own length it changes by this much.
    const auto led = [](const Field& d, const Field& ex, const Field& ey) {
        return [=](double x, double y) {
            double u = 0, v = 0;
            for (int i = 0; i < 20; ++i) {
                const double nu = ex(x + u, y + v), nv = ey(x + u, y + v);
                u = nu;
                v = nv;
            }
            return d(x + u, y + v);
        };
    };
    const Confident found = judge(flow, led(dx, dx, dy), led(dy, dx, dy));
    EXPECT_GT(found.share, 0.6);
    EXPECT_GT(found.right, 0.95);
}

TEST(PatchFlow, VectorsStandOnPixelsOfTheReference) {
    const Image image = drawn(texture_of(3), 100, 60);
    FlowOptions options;
    options.step = 9;
    options.patch = 45;
    const FlowField flow = patch_flow(image, image, nullptr, options);
    EXPECT_EQ(flow.width, 11);
    EXPECT_EQ(flow.height, 6);
    EXPECT_EQ(flow.step, 9);
    const std::size_t count = 66;
    EXPECT_EQ(flow.x.size(), count);
    EXPECT_EQ(flow.y.size(), count);
    EXPECT_EQ(flow.confidence.size(), count);
    std::vector<float> columns(count);
    for (int i = 0; i < 66; ++i) columns[i] = static_cast<float>(9 * (i % 11) + 4);
    const Image dense = at_every_pixel(flow, columns, 100, 60);
    for (int x = 4; x < 95; ++x) EXPECT_NEAR(dense.row(30)[x], x, 1e-3);
    EXPECT_EQ(dense.row(0)[0], 4) << "as the nearest beyond the grid";
    EXPECT_EQ(dense.row(59)[99], 94);
}

TEST(PatchFlow, DoesNotDependOnTheNumberOfThreads) {
    const Field texture = texture_of(4);
    const Image reference = drawn(texture, kWidth, kHeight);
    const Image other = seen_otherwise(texture, constant(3), constant(-2));
    const FlowField one = patch_flow(reference, other, nullptr, {}, 1);
    for (const int threads : {2, 3, 7}) {
        const FlowField more = patch_flow(reference, other, nullptr, {}, threads);
        EXPECT_EQ(more.x, one.x);
        EXPECT_EQ(more.y, one.y);
        EXPECT_EQ(more.confidence, one.confidence);
    }
}

TEST(PatchFlow, TellsNothingWhereTheSourceIsNotValid) {
    const Field texture = texture_of(5);
    const Image reference = drawn(texture, kWidth, kHeight);
    Image other = seen_otherwise(texture, constant(2), constant(1));
    std::vector<std::uint8_t> valid(kWidth * kHeight, 1);
    for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth / 2; ++x) {
            valid[y * kWidth + x] = 0;
            other.row(y)[x] = 0;
        }
    const FlowField flow = patch_flow(reference, other, valid.data());
    for (int row = 0; row < flow.height; ++row)
        for (int column = 0; column < flow.width; ++column)
            if (column * flow.step + flow.step / 2 < kWidth / 2 - 10) {
                EXPECT_LT(flow.confidence[row * flow.width + column], 0.5);
            }
    const Confident found = judge(flow, constant(2), constant(1));
    EXPECT_GT(found.share, 0.3) << "the other half";
    EXPECT_GT(found.right, 0.97);
    std::fill(valid.begin(), valid.end(), 0);
    for (const float confidence : patch_flow(reference, other, valid.data()).confidence)
        EXPECT_EQ(confidence, 0);
}

TEST(PatchFlow, EdgesOfOneDirectionDoNotTellTheWayAlongThem) {
    const Field texture = texture_of(6);
    const Field stripes = [&](double x, double) { return texture(x, 0); };
    const Image image = drawn(stripes, kWidth, kHeight);
    EXPECT_LT(judge(patch_flow(image, image, nullptr), constant(0), constant(0)).share, 0.02);
}

TEST(PatchFlow, UnrelatedImagesAreNotConfident) {
    const FlowField flow = patch_flow(drawn(texture_of(7), kWidth, kHeight),
                                      drawn(texture_of(8), kWidth, kHeight), nullptr);
    EXPECT_LT(judge(flow, constant(0), constant(0)).share, 0.05);
}

TEST(PatchFlow, FlatAndTinyImagesHaveNothingToTell) {
    const Image flat(kWidth, kHeight, 0.3f);
    for (const float confidence : patch_flow(flat, flat, nullptr).confidence)
        EXPECT_EQ(confidence, 0);
    EXPECT_TRUE(patch_flow(Image(5, 5), Image(5, 5), nullptr).x.empty());
    const FlowField one = patch_flow(Image(7, 8), Image(7, 8), nullptr);
    ASSERT_EQ(one.confidence.size(), 1u);
    EXPECT_EQ(one.confidence[0], 0);
}

TEST(PatchFlow, RefusesWhatItCannotUse) {
    const Image image(64, 48);
    EXPECT_TRUE(has(refusal([&] { patch_flow(image, Image(64, 47), nullptr); }),
                    "warped image is 64x47, expected the reference's 64x48"));
    const auto with = [&](auto set) {
        return refusal([&] {
            FlowOptions options;
            set(options);
            patch_flow(image, image, nullptr, options);
        });
    };
    EXPECT_TRUE(has(with([](FlowOptions& o) { o.step = 8; }), "flow step is 8, expected an odd"));
    EXPECT_TRUE(has(with([](FlowOptions& o) { o.step = 1; }), "flow step is 1, expected an odd"));
    EXPECT_TRUE(has(with([](FlowOptions& o) { o.patch = 42; }), "flow patch is 42, expected"));
    EXPECT_TRUE(has(with([](FlowOptions& o) { o.levels = 0; }), "flow levels is 0, expected"));
    EXPECT_TRUE(has(with([](FlowOptions& o) { o.max_shift = 0; }), "flow max_shift is 0, expec"));
}

}  // namespace
}  // namespace xcalib

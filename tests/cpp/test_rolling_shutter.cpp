#include <gtest/gtest.h>

#include <cmath>

#include "refusal.hpp"
#include "streams.hpp"
#include "xcalib/footage/rolling_shutter.hpp"
#include "xcalib/stream/straightened.hpp"

namespace xcalib {
namespace {

using namespace testing;

Rig rig_of_one_eye(double source_fov_deg) {
    Rig rig;
    rig.reference = Pinhole::from_hfov(81, 61, 60 * EIGEN_PI / 180);
    rig.source = Pinhole::from_hfov(41, 41, source_fov_deg * EIGEN_PI / 180);
    return rig;
}

TEST(RowDelay, IsThatOfTheSourceAlone) {
    const RowDelay delay = row_delay({0.5, 0}, std::nullopt, 40, 41);
    EXPECT_EQ(delay(17, 0), 0);
    EXPECT_DOUBLE_EQ(delay(3, 40), 0.5);
    EXPECT_DOUBLE_EQ(delay(0, 20), 0.25);
}

TEST(RowDelay, OfTwoCamerasIsWhatTheyDifferBy) {
    EXPECT_NEAR(row_delay({0.5, 0.5}, std::nullopt, 40, 41)(5, 33), 0, 1e-15);
    // A source that sees half as far up and down: its rows are read over all of the time, those of
    // the reference which look the same way over half of it.
    Rig rig = rig_of_one_eye(60);
    rig.reference.fx = rig.reference.fy = 40;
    rig.source.fx = rig.source.fy = 2 * 40 * 40.0 / 60;  // 40 rows for 30 of the reference
    const RowDelay delay = row_delay({1, 1}, rig, 41, 41);
    EXPECT_NEAR(delay(20, 20), 0, 1e-9);
    EXPECT_NEAR(delay(20, 40), 0.25, 1e-4);
    EXPECT_NEAR(delay(7, 0), -0.25, 1e-4);
    // The same in frames of twice the size.
    EXPECT_NEAR(row_delay({1, 1}, rig, 82, 82)(40, 81), 0.25, 0.01);
}

TEST(RowDelay, TurnedBySidewaysRowsOfTheReferenceAreColumns) {
    Rig rig = rig_of_one_eye(60);
    rig.source_from_reference.rotation =
        Eigen::AngleAxisd(0.5 * EIGEN_PI, Eigen::Vector3d::UnitZ());
    const RowDelay delay = row_delay({0, 0.6}, rig, 41, 41);
    EXPECT_NEAR(delay(20, 20), -0.3, 1e-6);  // the middle of the reference's readout
    EXPECT_NEAR(delay(20, 5), delay(20, 35), 1e-6);
    EXPECT_GT(std::abs(delay(0, 20) - delay(40, 20)), 0.1);
}

TEST(Readout, IsAShare) {
    EXPECT_EQ(parse_readout("--source-readout", "0.25"), 0.25);
    EXPECT_EQ(parse_readout("--source-readout", "auto"), std::nullopt);
    for (const char* text : {"-0.1", "1.1", "nan", "", "0.5s", "half"})
        EXPECT_TRUE(has(refusal([&] { parse_readout("--source-readout", text); }),
                        "--source-readout " + std::string(text)));
}

// What stands at column u of row v is u + 100, moved by 8 px from frame to frame.
TEST(Straighten, MovesRowsBackToWhereTheyWere) {
    constexpr int kSide = 33;
    std::vector<float> read(kSide * kSide), out(kSide * kSide);
    for (int v = 0; v < kSide; ++v)
        for (int u = 0; u < kSide; ++u)
            read[v * kSide + u] = 100 + u - 8 * 0.5f * static_cast<float>(v) / (kSide - 1);
    const Motion motion{Image(11, 11, 8.0f), Image(11, 11, 0.0f)};
    const RowDelay delay = row_delay({0.5, 0}, std::nullopt, kSide, kSide);
    const ImageView view{read.data(), kSide, kSide, 1, PixelType::f32, 4 * kSide};
    straighten(view, motion, delay, false,
               {out.data(), kSide, kSide, 1, PixelType::f32, 4 * kSide});
    for (int v = 0; v < kSide; ++v)
        for (int u = 1; u < kSide - 6; ++u)
            EXPECT_NEAR(out[v * kSide + u], 100 + u, 0.05) << u << " " << v;
    // Values are those that were there.
    straighten(view, motion, delay, true, {out.data(), kSide, kSide, 1, PixelType::f32, 4 * kSide});
    for (int v = 0; v < kSide; ++v)
        for (int u = 0; u < kSide - 6; ++u) {
            const float value = out[v * kSide + u];
            EXPECT_LE(std::abs(value - static_cast<float>(100 + u)), 0.5f);
            EXPECT_EQ(value - read[v * kSide], std::round(value - read[v * kSide]));
        }
}

// Says how far the second frame's value is from the first one's.
Motion value_step(const ImageView& from, const ImageView& to) {
    const float step = static_cast<float>(to.row<std::uint8_t>(0)[0]) -
                       static_cast<float>(from.row<std::uint8_t>(0)[0]);
    return {Image(from.width, from.height, step), Image(from.width, from.height, 0.0f)};
}

// Frames of a ramp that moves to the left by 3 px a frame.
class Ramp : public PlainStream {
   public:
    using PlainStream::PlainStream;

   private:
    Picture read(int index) override {
        if (index == lost) throw DecodeError("frame lost");
        MutableImageView pixels;
        Picture out = new_picture(16, 12, 1, PixelType::u8, pixels);
        for (int i = 0; i < 16 * 12; ++i)
            static_cast<std::uint8_t*>(pixels.data)[i] =
                static_cast<std::uint8_t>(10 * (i % 16) + 3 * index);
        return out;
    }

   public:
    int lost = -1;
};

Motion three_px(const ImageView& from, const ImageView& to) {
    const float way = value_step(from, to).x.pixels[0] > 0 ? 1.0f : -1.0f;
    return {Image(from.width, from.height, 3 * way), Image(from.width, from.height, 0.0f)};
}

int last_row(const Picture& picture, int u) { return picture.view.row<std::uint8_t>(11)[u]; }

TEST(StraightenedStream, LooksAtTheNextFrameElseAtTheLast) {
    const auto ramp = std::make_shared<Ramp>("v", 4);
    const StreamPointer stream = straightened(ramp, {1, 0}, std::nullopt, three_px, false);
    // The last row is a frame late: 3 px, of 10 each.
    EXPECT_EQ(last_row((*stream)[1], 5), 10 * (5 + 3) + 3);
    EXPECT_EQ((*stream)[1].view.row<std::uint8_t>(0)[5], 10 * 5 + 3);
    EXPECT_EQ(last_row((*stream)[3], 5), 10 * (5 + 3) + 9) << "from the frame before";
    EXPECT_EQ(stream->name(2), "000002");
    ramp->lost = 2;
    const StreamPointer again = straightened(ramp, {1, 0}, std::nullopt, three_px, false);
    EXPECT_EQ(last_row((*again)[1], 5), 10 * 5 + 3) << "as it is";
}

TEST(StraightenedStream, IsTheStreamWhereAllIsReadAtOnce) {
    const StreamPointer ramp = std::make_shared<Ramp>("v", 4);
    EXPECT_EQ(straightened(ramp, {0, 0}, std::nullopt, three_px, false), ramp);
}

TEST(StraightenedStream, IsOfFramesThatFollowEachOther) {
    const StreamPointer one = std::make_shared<Ramp>("v", 1);
    EXPECT_TRUE(has(refusal([&] {
                        straightened(one, {1, 0}, std::nullopt, three_px, false);
                    }),
                    "--source-readout: v frame 0"));
    EXPECT_TRUE(has(refusal([&] {
                        straightened(one, {0, 1}, std::nullopt, three_px, false);
                    }),
                    "--reference-readout: v frame 0"));
}

}  // namespace
}  // namespace xcalib

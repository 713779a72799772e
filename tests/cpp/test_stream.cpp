#include <gtest/gtest.h>

#include "refusal.hpp"
#include "streams.hpp"
#include "xcalib/error.hpp"

namespace xcalib {
namespace {

using namespace testing;

int value(const Picture& picture, int x = 0, int y = 0) {
    return picture.view.row<std::uint8_t>(y)[x];
}

TEST(Streams, ArePickedInAnyOrderWithTheirTimes) {
    const auto all = std::make_shared<PlainStream>("v", 5);
    all->times = std::vector<double>{0, 1, 2, 3, 4};
    const StreamPointer some = picked(all, {3, 1});
    EXPECT_EQ(some->size(), 2);
    EXPECT_EQ(value((*some)[0]), 3);
    EXPECT_EQ(some->name(1), "000001");
    EXPECT_EQ(some->where(0), "v frame 3");
    EXPECT_EQ(some->file(0), "v");
    EXPECT_EQ(*some->times, (std::vector<double>{3, 1}));
    EXPECT_TRUE(some->concurrent());
    EXPECT_EQ(picked(all, {0, 1, 2, 3, 4}), all);
}

TEST(Streams, AreOfOneSize) {
    PlainStream stream("folder/v", 3);
    stream[1];
    stream.width = 20;
    EXPECT_EQ(refusal([&] { stream[2]; }),
              "folder/v frame 2 is 20x12, expected 16x12 as v frame 1");
}

TEST(Streams, HalvesAreOfTheImageBesideOrAbove) {
    const auto whole = std::make_shared<Converted>(
        std::make_shared<PlainStream>("v", 2), [](const Picture& picture, int) {
            MutableImageView pixels;
            const Picture out =
                new_picture(picture.view.width, picture.view.height, 3, PixelType::u8, pixels);
            for (int y = 0; y < pixels.height; ++y)
                for (int x = 0; x < 3 * pixels.width; ++x)
                    static_cast<std::uint8_t*>(pixels.data)[y * pixels.row_bytes + x] =
                        static_cast<std::uint8_t>(10 * y + x / 3);
            return out;
        });
    const auto at = [&](const char* half, int x, int y) {
        Half stream(whole, half);
        const Picture picture = stream[1];
        EXPECT_EQ(picture.view.channels, 3);
        return value(picture, 3 * x, y);
    };
    EXPECT_EQ(at("left", 2, 3), 32);
    EXPECT_EQ(at("right", 2, 3), 32 + 8);
    EXPECT_EQ(at("top", 2, 3), 32);
    EXPECT_EQ(at("bottom", 2, 3), 10 * 9 + 2);
    EXPECT_EQ(Half(whole, "left").where(1), "v frame 1 (left half)");
    const auto odd = std::make_shared<PlainStream>("v", 1);
    odd->width = 15;
    EXPECT_EQ(refusal([&] { Half(odd, "right")[0]; }),
              "v frame 0: its width is 15 px, expected an even one to take the right half");
}

TEST(Streams, HaveTimesOfTables) {
    const Scratch scratch;
    write_text(scratch / "times.csv", "000000.png,1.5\n000001.png,2.5\n");
    EXPECT_EQ(read_times(scratch / "times.csv", PlainStream("v", 2)),
              (std::vector<double>{1.5, 2.5}));
    EXPECT_THROW(read_times(scratch / "none", PlainStream("v", 2)), std::system_error);
}

TEST(LoadedFrames, AreThoseThatCanBeDecoded) {
    const auto broken = [](int frame) {
        if (frame % 2) throw DecodeError("frame " + std::to_string(frame));
    };
    const Frames frames{std::make_shared<PlainStream>("v", 9),
                        std::make_shared<PlainStream>("t", 9, true, broken),
                        std::make_shared<PlainDepth>()};
    std::vector<int> reported;
    const auto note = [&](int done) { reported.push_back(done); };
    const LoadedFrames loaded = load_frames(frames, {2, 3, 5, 8}, note);
    EXPECT_EQ(loaded.indices, (std::vector<int>{2, 8}));
    EXPECT_EQ(value(loaded.frames[1].source), 8);
    EXPECT_EQ(loaded.views(&Frame::depth).size(), 2u);
    EXPECT_EQ(loaded.failures, 2);
    EXPECT_EQ(left_out(loaded.failures, loaded.first_failure),
              "2 unusable frames are left out; frame 3");
    EXPECT_EQ(reported, (std::vector<int>{1, 2, 3, 4}));
    EXPECT_THROW(load_frames(frames, {3, 5}, note), DecodeError);
    EXPECT_EQ(refusal([&] { load_frames(frames, {}, note); }), "no frame to calibrate on");
}

TEST(LoadedFrames, AreNamedInMessagesOfTheCore) {
    const PlainStream images("v", 9);
    EXPECT_EQ(with_file_name("depth frame 1 is bad", images, {4, 7}),
              "depth frame 1 is bad (frame 1 is v frame 7)");
    EXPECT_EQ(with_file_name("frame 9 is bad", images, {4, 7}), "frame 9 is bad");
    EXPECT_EQ(with_file_name("all is bad", images, {4, 7}), "all is bad");
}

}  // namespace
}  // namespace xcalib

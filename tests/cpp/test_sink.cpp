#include <gtest/gtest.h>

#include <optional>

#include "refusal.hpp"
#include "streams.hpp"
#include "xcalib/stream/interrupts.hpp"

namespace xcalib {
namespace {

using namespace testing;
using Files = std::map<std::string, std::string>;

const MadeWith kMadeBySink = {{"command", "test"}};

std::string key_of(int index) { return "0123456789abcd" + std::to_string(10 + index); }

std::vector<FrameName> frames(int count) {
    std::vector<FrameName> names;
    for (int i = 0; i < count; ++i) names.push_back({key_of(i), six_digits(i)});
    return names;
}

Registered pictures(int value, bool overlay = false) {
    return {plain(4, 2, value), plain(4, 2, value % 2),
            overlay ? plain(4, 2, value, 3) : Picture()};
}

// One run of a sink over `count` frames of which `stop` are written, those that are there left out.
class SinkOfAnOutput : public ::testing::Test {
   protected:
    std::map<std::string, long> run(int count, int stop, bool finish = true) {
        Journal journal(journal_of(out()), kMadeBySink);
        const std::unique_ptr<Sink> sink = open_sink(out(), 25, &journal, codecs, 3);
        const std::vector<FrameName> names = frames(count);
        std::map<std::string, long> done = sink->begin(names);
        for (int i = 0; i < stop; ++i)
            if (!done.count(names[i].key)) {
                sink->write(i, names[i], pictures(i, overlays));
                ++written;
            }
        if (finish) sink->finish(names, [] {});
        else sink->keep();
        return done;
    }
    std::filesystem::path out() const { return scratch / name; }

    Scratch scratch;
    TextCodecs codecs;
    std::string name;
    bool overlays = false;
    int written = 0;
};

class FolderSinks : public SinkOfAnOutput {
   protected:
    FolderSinks() { name = "out"; }
};

TEST_F(FolderSinks, WriteUnderTheNamesOfTheFrames) {
    overlays = true;
    run(2, 2);
    Files files = files_below(out());
    files.erase("register.jsonl");
    EXPECT_EQ(files, (Files{{"000000.png", "0\n"},
                            {"000001.png", "1\n"},
                            {"masks/000000.png", "0\n"},
                            {"masks/000001.png", "1\n"},
                            {"overlays/000000.png", "0\n"},
                            {"overlays/000001.png", "1\n"}}));
}

TEST_F(FolderSinks, KnowWhatIsThere) {
    run(4, 3, false);
    write_text(out() / "masks/.000002.png.0123456789abcdef.partial", "half");  // of a killed run
    std::filesystem::remove(out() / "000001.png");
    const auto done = run(4, 4);
    EXPECT_EQ(done, (std::map<std::string, long>{{key_of(0), 8}, {key_of(2), 8}}));
    EXPECT_EQ(written, 3 + 2);
    EXPECT_FALSE(std::filesystem::exists(out() / "masks/.000002.png.0123456789abcdef.partial"));
    EXPECT_EQ(run(2, 0).size(), 2u);  // of frames that are not wanted nothing is said
}

TEST_F(FolderSinks, FloatsAreTiff) {
    const std::unique_ptr<Sink> sink = open_sink(out(), 25, nullptr, codecs);
    EXPECT_TRUE(sink->concurrent());
    write_text(scratch / "x", "");
    Registered result = pictures(0);
    const Image image(4, 2, 0.0f);
    result.image = {image.view(), nullptr};
    sink->write(0, {"k", "a"}, result);
    sink->keep();
    EXPECT_TRUE(std::filesystem::exists(out() / "a.tiff"));
    EXPECT_TRUE(std::filesystem::exists(out() / "masks/a.png"));
}

class VideoSinks : public SinkOfAnOutput {
   protected:
    VideoSinks() { name = "out.mkv"; }
    Files all() const { return files_below(scratch / ""); }
};

constexpr const char* kEight = "0\n1\n2\n3\n4\n5\n6\n7\n";

TEST_F(VideoSinks, AreOneVideoForEachKindOfPicture) {
    overlays = true;
    run(8, 8);
    Files files = all();
    EXPECT_EQ(files.erase("out.mkv.register.jsonl"), 1u);
    EXPECT_EQ(files, (Files{{"out.mkv", kEight},
                            {"out.masks.mkv", "0\n1\n0\n1\n0\n1\n0\n1\n"},
                            {"out.overlay.mkv", kEight}}));
    EXPECT_EQ(run(8, 8).size(), 8u);
    EXPECT_EQ(written, 8);  // done is done
    EXPECT_EQ(all().size(), 4u);
}

TEST_F(VideoSinks, GoOnWhereTheyEnded) {
    run(8, 5, false);
    EXPECT_EQ(all().size(), 1 + 2 * 2u);  // parts of 3 and 2 frames
    EXPECT_EQ(run(8, 6, false).size(), 5u);
    EXPECT_EQ(run(8, 8).size(), 6u);
    EXPECT_EQ(written, 8);
    EXPECT_EQ(text_of(out()), kEight);
    EXPECT_FALSE(std::filesystem::exists(scratch / "out.mkv.parts"));
}

TEST_F(VideoSinks, KilledLoseTheOpenPartAndNoMore) {
    {
        Journal journal(journal_of(out()), kMadeBySink);
        auto sink = open_sink(out(), 25, &journal, codecs, 3);
        const auto names = frames(8);
        sink->begin(names);
        for (int i = 0; i < 5; ++i) sink->write(i, names[i], pictures(i));
        // As a kill leaves it: neither kept nor thrown away.
        std::filesystem::copy(scratch / "out.mkv.parts", scratch / "copy");
        std::filesystem::copy_file(journal_of(out()), scratch / "copied journal");
        sink.reset();
    }
    std::filesystem::remove_all(scratch / "out.mkv.parts");
    std::filesystem::rename(scratch / "copy", scratch / "out.mkv.parts");
    std::filesystem::rename(scratch / "copied journal", journal_of(out()));
    EXPECT_EQ(run(8, 8).size(), 3u);
    EXPECT_EQ(written, 5);
    EXPECT_EQ(text_of(out()), kEight);
    EXPECT_FALSE(std::filesystem::exists(scratch / "out.mkv.parts"));
}

TEST_F(FolderSinks, LeaveAloneWhatOthersHavePutThere) {
    const std::filesystem::path digits = ".0123456789abcdef.partial";
    run(4, 3, false);
    std::filesystem::create_directory_symlink(scratch / "elsewhere", out() / "overlays");
    const Files others = {{"out/.x.partial", "1"},
                          {"out/.x" + digits.string(), "2"},
                          {"out/.000003.png.partial", "3"},
                          {"out/masks/.000003.png.0123.partial", "4"},
                          {"elsewhere/.000003.png" + digits.string(), "5"}};
    for (const auto& [name, text] : others) write_text(scratch / name, text);
    run(4, 4);
    for (const auto& [name, text] : others) EXPECT_EQ(text_of(scratch / name), text) << name;
}

TEST_F(VideoSinks, LeaveAloneWhatOthersHavePutAmongTheParts) {
    run(8, 5, false);
    const Files others = {{"out.mkv.parts/mine", "1"},
                          {"out.mkv.parts/0123456789abcdef.mkv", "2"},
                          {"out.mkv.parts/.mine.0123456789abcdef.partial", "3"},
                          {"elsewhere", "4"}};
    for (const auto& [name, text] : others) write_text(scratch / name, text);
    // A link where a part would be is replaced, not followed.
    const auto link = scratch / ("out.mkv.parts/" + key_of(5) + ".mkv");
    std::filesystem::create_symlink(scratch / "elsewhere", link);
    run(8, 8);
    EXPECT_EQ(text_of(out()), kEight);
    for (const auto& [name, text] : others) EXPECT_EQ(text_of(scratch / name), text) << name;
}

TEST_F(VideoSinks, RefuseAFolderOfPartsThatIsALink) {
    std::filesystem::create_directory(scratch / "elsewhere");
    std::filesystem::create_symlink(scratch / "elsewhere", scratch / "out.mkv.parts");
    EXPECT_TRUE(has(refusal([&] { run(8, 8); }), "out.mkv.parts is no folder"));
}

TEST_F(VideoSinks, OfOtherFramesKeepThePartsThatStillFollow) {
    run(8, 8, false);
    Journal journal(journal_of(out()), kMadeBySink);
    const auto sink = open_sink(out(), 25, &journal, codecs, 3);
    auto names = frames(8);
    names[4].key = "fedcba9876543210";  // its file has changed, and so the part of frames 3 to 5
    const auto done = sink->begin(names);
    EXPECT_EQ(done.size(), 5u);
    EXPECT_FALSE(done.count(key_of(3)) || done.count(key_of(5)));
    for (const int i : {3, 4, 5}) sink->write(i, names[i], pictures(10 + i));
    sink->finish(names, [] {});
    EXPECT_EQ(text_of(out()), "0\n1\n2\n13\n14\n15\n6\n7\n");
}

TEST_F(VideoSinks, AreNotJoinedWhereFramesAreMissing) {
    EXPECT_THROW(run(8, 7), std::runtime_error);
    EXPECT_FALSE(std::filesystem::exists(out()));
    EXPECT_EQ(run(8, 8).size(), 7u);
}

TEST_F(VideoSinks, InterruptedWhileJoinedHaveAllTheirParts) {
    {
        Journal journal(journal_of(out()), kMadeBySink);
        const auto sink = open_sink(out(), 25, &journal, codecs, 3);
        const auto names = frames(8);
        sink->begin(names);
        for (int i = 0; i < 8; ++i) sink->write(i, names[i], pictures(i));
        int calls = 0;
        EXPECT_THROW(sink->finish(names,
                                  [&] {
                                      if (++calls == 5) throw Interrupted();
                                  }),
                     Interrupted);
    }
    EXPECT_FALSE(std::filesystem::exists(out()));
    EXPECT_EQ(run(8, 8).size(), 8u);
    EXPECT_EQ(text_of(out()), kEight);
}

TEST_F(VideoSinks, WithADiskThatFillsUpKeepWhatIsWhole) {
    int left = 10;
    codecs.meet = [&](const std::string&) {
        if (--left < 0) throw std::system_error(ENOSPC, std::generic_category(), "out.mkv");
    };
    EXPECT_THROW(run(8, 8), std::system_error);
    for (const auto& [file, text] : all()) EXPECT_EQ(file.find("partial"), std::string::npos);
    codecs.meet = [](const std::string&) {};
    EXPECT_EQ(run(8, 8).size(), 5u);
    EXPECT_EQ(text_of(out()), kEight);
}

TEST_F(VideoSinks, RefuseFramesOfAnotherKind) {
    const auto sink = open_sink(out(), 25, nullptr, codecs);
    EXPECT_FALSE(sink->concurrent());
    sink->begin({});
    sink->write(0, {"a", "a"}, pictures(0));
    Registered other = pictures(1);
    other.image = plain(4, 2, 1, 3);
    EXPECT_EQ(refusal([&] {
                  sink->write(1, {"b", "b"}, other);
              }),
              out().string() +
                  ": a frame is 4x2 uint8 colour, the first is 4x2 uint8 gray; a video holds frames"
                  " of one kind, a folder any");
}

TEST(VideoImages, AreWhatTheSuffixHolds) {
    const ImageView u8{nullptr, 4, 2, 3, PixelType::u8, 0}, odd{nullptr, 5, 2, 1, PixelType::u8, 0},
        u16{nullptr, 4, 2, 1, PixelType::u16, 0}, deep{nullptr, 4, 2, 3, PixelType::u16, 0},
        f32{nullptr, 4, 2, 1, PixelType::f32, 0};
    const auto message = [](const char* file, const ImageView& image) {
        return refusal([&] { check_video_image(file, image); });
    };
    EXPECT_EQ(message("a.mp4", u8), "");
    EXPECT_EQ(message("a.MKV", u16), "");
    EXPECT_EQ(message("a.mp4", u16),
              "a.mp4: the images are uint16 gray; .mp4 holds uint8, a folder holds any");
    EXPECT_EQ(
        message("a.mkv", deep),
        "a.mkv: the images are uint16 colour; .mkv holds uint8 and gray uint16, a folder holds"
        " any");
    EXPECT_TRUE(has(message("a.mkv", f32), "float32 gray"));
    EXPECT_EQ(message("a.avi", odd),
              "a.avi: the images are 5x2; a video holds even sizes, a folder any");
}

TEST(Outputs, AreNotThoseOfOthers) {
    const Scratch scratch;
    const std::vector<FrameName> names = frames(2);
    const auto refused = [&](const std::filesystem::path& output, bool overlays = false) {
        return refusal([&] { check_not_others(output, output_files(output, names, overlays)); });
    };
    for (const char* file : {"out/masks/000001.png", "o.masks.mkv", "p.overlay.mp4"})
        write_text(scratch / file, "mine");
    EXPECT_EQ(refused(scratch / "out"),
              (scratch / "out/masks/000001.png").string() + " is there, and " +
                  (scratch / "out/register.jsonl").string() +
                  " does not say that a run made it; expected another output, or --overwrite");
    EXPECT_TRUE(has(refused(scratch / "o.avi"), "o.masks.mkv is there"));
    EXPECT_EQ(refused(scratch / "p.mp4"), "");
    EXPECT_TRUE(has(refused(scratch / "p.mp4", true), "p.overlay.mp4 is there"));
}

TEST(Outputs, ShareNoMasks) {
    const Scratch scratch;
    const auto refused = [&](const char* name) {
        return refusal([&] { check_alone(scratch / name); });
    };
    write_text(scratch / "o.mp4.register.jsonl", "of o.mp4");
    write_text(scratch / "q.avi.register.jsonl", "");  // which has made nothing yet
    EXPECT_EQ(refused("o.avi"), (scratch / "o.avi").string() + " would share o.masks.mkv with " +
                                    (scratch / "o.mp4").string() + ", expected another name");
    for (const char* name : {"o.mp4", "p.avi", "q.mkv", "o"}) EXPECT_EQ(refused(name), "") << name;
}

TEST(Outputs, AreVideosByTheirSuffixUnlessFolders) {
    const Scratch scratch;
    EXPECT_TRUE(is_video_output("out.MP4"));
    EXPECT_FALSE(is_video_output("out"));
    EXPECT_FALSE(is_video_output("out.png"));
    std::filesystem::create_directory(scratch / "folder.mkv");
    EXPECT_FALSE(is_video_output(scratch / "folder.mkv"));
    EXPECT_EQ(journal_of("a/out.mkv"), "a/out.mkv.register.jsonl");
    EXPECT_EQ(journal_of("a/out"), "a/out/register.jsonl");
}

}  // namespace
}  // namespace xcalib

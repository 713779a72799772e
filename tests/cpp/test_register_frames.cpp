#include <gtest/gtest.h>

#include <atomic>
#include <csignal>

#include "refusal.hpp"
#include "streams.hpp"
#include "xcalib/error.hpp"
#include "xcalib/stream/interrupts.hpp"
#include "xcalib/stream/register_frames.hpp"

namespace xcalib {
namespace {

using namespace testing;
using Files = std::map<std::string, std::string>;

Rig straight() {
    Rig rig;
    rig.reference = rig.source = {16, 12, 20, 20, 7.5, 5.5};
    return rig;
}

class RegisteringFrames : public ::testing::TestWithParam<const char*> {
   protected:
    static constexpr int kCount = 40;

    Registration run(int threads = 3, const std::string& command = "test",
                     const MadeWith& inputs = {{"far", "60"}}) {
        RegistrationOptions options;
        options.registrar.num_threads = threads;
        options.part_frames = 4;
        options.overwrite = overwrite;
        return register_frames(frames(), straight(), out(), options, command, inputs, {}, codecs,
                               [this](const Registration& now) { last = now; });
    }
    Frames frames() const {
        return {std::make_shared<PlainStream>(scratch / "v", kCount, concurrent, meet_reference),
                std::make_shared<PlainStream>(scratch / "t", kCount, concurrent, meet_source),
                std::make_shared<PlainDepth>(steadied, meet_depth)};
    }
    std::filesystem::path out() const { return scratch / std::string(GetParam()); }
    bool video() const { return is_video_output(out()); }
    // All that was written, but the journal.
    Files contents() const {
        Files files = files_below(scratch / "");
        files.erase(journal_of(GetParam()).string());
        return files;
    }
    void expect_whole() const {
        const Files files = contents();
        if (video()) {
            std::string all;
            for (int i = 0; i < kCount; ++i) all += std::to_string(i) + "\n";
            EXPECT_EQ(files.at("out.mkv"), all);
            EXPECT_EQ(files.size(), 2u);
        } else {
            EXPECT_EQ(files.size(), 2u * kCount);
            EXPECT_EQ(files.at("out/000007.png"), "7\n");
        }
    }

    Scratch scratch;
    TextCodecs codecs;
    std::function<void(int)> meet_reference = [](int) {}, meet_source = [](int) {},
                             meet_depth = [](int) {};
    bool concurrent = true, steadied = false, overwrite = false;
    Registration last;
};
INSTANTIATE_TEST_SUITE_P(Outputs, RegisteringFrames, ::testing::Values("out", "out.mkv"),
                         [](const auto& info) {
                             return std::string(info.param) == "out" ? "Folder" : "Video";
                         });

TEST_P(RegisteringFrames, MakesThemAllAndSaysSo) {
    const Registration total = run();
    expect_whole();
    EXPECT_EQ(total.frames, kCount);
    EXPECT_EQ(total.made, kCount);
    EXPECT_EQ(total.earlier, 0);
    EXPECT_EQ(total.pixels, 16L * 12 * kCount);
    EXPECT_GT(total.valid, total.pixels / 2);
    EXPECT_EQ(last.made, kCount);
    EXPECT_EQ(total.summary().rfind("40 frames, ", 0), 0u) << total.summary();
    EXPECT_TRUE(has(total.summary(), " frames/s with files, busy: decode "));
    EXPECT_TRUE(has(last.line(), "40 of 40 frames, "));
    EXPECT_TRUE(has(last.line(), " s left, busy: decode "));
    const Registration again = run();
    EXPECT_EQ(again.made, 0);
    EXPECT_EQ(again.valid, total.valid);
    EXPECT_TRUE(has(again.summary(), "40 frames (40 from before), "));
    EXPECT_FALSE(has(again.summary(), "frames/s"));
}

TEST_P(RegisteringFrames, DoesNotDependOnThreads) {
    run(1);
    const Files one = contents();
    std::filesystem::remove_all(scratch / "");
    concurrent = false;
    run(4);
    EXPECT_EQ(contents(), one);
}

TEST_P(RegisteringFrames, InterruptedGoesOnAndRepeatsNothing) {
    std::map<std::string, int> times;  // that a picture was written
    std::mutex mutex;
    codecs.meet = [&](const std::string& name) {
        const std::lock_guard lock(mutex);
        ++times[name];
    };
    int done = 0;
    for (const int signal : {SIGINT, SIGTERM}) {
        std::atomic<int> read{0};
        meet_source = [&](int) {
            if (++read == 10) std::raise(signal);
        };
        const Interrupts held;
        std::string state;
        try {
            EXPECT_EQ(run().made, -1) << "not interrupted";
        } catch (const Interrupted& error) {
            state = error.what();
        }
        EXPECT_TRUE(has(state, " of 40 frames are done, the same command goes on from there"));
        const int before = done;
        ASSERT_EQ(std::sscanf(state.c_str(), "interrupted; %d of", &done), 1) << state;
        EXPECT_EQ(last.earlier, before);
        EXPECT_GE(done, before + 8);  // the first frame is read once more, for its size
        EXPECT_LE(done, before + 12);
        for (const auto& [file, text] : contents())
            EXPECT_EQ(file.find("partial"), std::string::npos) << file;
    }
    meet_source = [](int) {};
    EXPECT_EQ(run().earlier, done);
    expect_whole();
    for (const auto& [name, count] : times) EXPECT_TRUE(video() || count == 2) << name;  // and mask
}

TEST_P(RegisteringFrames, AnErrorInAStageKeepsWhatCameBefore) {
    const auto fail = [](int frame) {
        if (frame >= 20) throw DecodeError("frame " + std::to_string(frame));
    };
    for (std::function<void(int)>* stage : {&meet_reference, &meet_source, &meet_depth}) {
        std::filesystem::remove_all(scratch / "");
        *stage = fail;
        EXPECT_EQ(refusal([&] { run(); }), "frame 20");
        EXPECT_EQ(contents().count("out/000021.png"), 0u);
        *stage = [](int) {};
        EXPECT_EQ(run().earlier, 20);
        expect_whole();
    }
}

TEST_P(RegisteringFrames, ADiskThatFillsUpIsAnError) {
    std::atomic<int> left{30};
    codecs.meet = [&](const std::string& name) {
        if (--left < 0) throw std::system_error(ENOSPC, std::generic_category(), name);
    };
    EXPECT_THROW(run(), std::system_error);
    for (const auto& [file, text] : contents())
        EXPECT_EQ(file.find("partial"), std::string::npos) << file;
    codecs.meet = [](const std::string&) {};
    EXPECT_GT(run().earlier, 10);
    expect_whole();
}

TEST_P(RegisteringFrames, ReplacesNothingThatOthersHaveMade) {
    const auto file = video() ? out() : out() / "000003.png";
    write_text(file, "mine");
    EXPECT_TRUE(has(refusal([&] { run(); }), file.string() + " is there"));
    EXPECT_EQ(contents(), (Files{{file.lexically_relative(scratch / "").string(), "mine"}}));
    overwrite = true;
    run();
    expect_whole();
}

TEST_P(RegisteringFrames, MadeOtherwiseIsRefused) {
    run();
    EXPECT_TRUE(has(refusal([&] { run(3, "test", {{"far", "40"}}); }), "(far 60, now 40)"));
    EXPECT_TRUE(has(refusal([&] {
                        run(3, "other", {{"far", "40"}});
                    }),
                    "(command test, now other); expected the same, another output, or"
                    " --overwrite"));
    expect_whole();
}

TEST_P(RegisteringFrames, SteadiedDepthSeesTheFramesBeforeAsWell) {
    steadied = true;
    std::vector<int> seen;
    meet_depth = [&](int frame) {
        seen.push_back(frame);
        if (frame == 12) throw InputError("enough");
    };
    EXPECT_EQ(refusal([&] { run(); }), "enough");
    seen.clear();
    meet_depth = [&](int frame) { seen.push_back(frame); };
    EXPECT_EQ(run().earlier, 12);
    std::vector<int> all;
    for (int i = 0; i < kCount; ++i) all.push_back(i);
    EXPECT_EQ(seen, all);
    expect_whole();
}

TEST(FrameNames, ChangeWithTheFilesAndNotWithTheirPaths) {
    const Scratch scratch;
    for (const char* name : {"v", "t"}) write_text(scratch / name, name);
    const auto keys = [](const std::filesystem::path& v, const std::filesystem::path& t,
                         bool steadied = false) {
        std::vector<std::string> keys;
        for (const FrameName& frame :
             frame_names({std::make_shared<PlainStream>(v, 3), std::make_shared<PlainStream>(t, 3),
                          std::make_shared<PlainDepth>(steadied)}))
            keys.push_back(frame.key);
        return keys;
    };
    const auto before = keys(scratch / "v", scratch / "t");
    EXPECT_EQ(std::set<std::string>(before.begin(), before.end()).size(), 3u);
    EXPECT_EQ(keys(scratch / "./v", scratch / ".//t"), before);
    const auto steadied = keys(scratch / "v", scratch / "t", true);
    EXPECT_EQ(steadied[0], before[0]);
    EXPECT_NE(steadied[1], before[1]);
    write_text(scratch / "t", "more");
    EXPECT_NE(keys(scratch / "v", scratch / "t"), before);
}

TEST(HeldInterrupts, AreNotedOnceAndThenLetThrough) {
    static std::atomic<int> came;
    came = 0;
    const auto previous = std::signal(SIGTERM, [](int) { ++came; });
    {
        const Interrupts held;
        EXPECT_FALSE(interrupted());
        EXPECT_NO_THROW(check_interrupts());
        std::raise(SIGTERM);
        EXPECT_TRUE(interrupted());
        EXPECT_THROW(check_interrupts(), Interrupted);
        EXPECT_EQ(came, 0);
        std::raise(SIGTERM);
        EXPECT_EQ(came, 1);
    }
    EXPECT_FALSE(interrupted());
    std::raise(SIGTERM);
    EXPECT_EQ(came, 2);
    std::signal(SIGTERM, previous);
}

TEST(HeldInterrupts, StayIgnored) {
    const auto previous = std::signal(SIGINT, SIG_IGN);
    {
        const Interrupts held;
        std::raise(SIGINT);
        EXPECT_FALSE(interrupted());
    }
    EXPECT_EQ(std::signal(SIGINT, previous), SIG_IGN);
}

}  // namespace
}  // namespace xcalib

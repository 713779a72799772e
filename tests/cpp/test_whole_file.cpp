#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <set>
#include <system_error>
#include <thread>

#include "base/read_file.hpp"
#include "base/whole_file.hpp"
#include "refusal.hpp"
#include "scratch.hpp"

namespace xcalib {
namespace {

using namespace testing;
namespace fs = std::filesystem;
using Files = std::map<std::string, std::string>;

TEST(WholeFile, HasItsNameOnlyWhenItIsComplete) {
    const Scratch scratch;
    write_text(scratch / "a", "old");
    {
        WholeFile file(scratch / "a");
        file.write("half");
        EXPECT_EQ(text_of(scratch / "a"), "old");
    }
    EXPECT_EQ(files_below(scratch / ""), (Files{{"a", "old"}}));
    WholeFile file(scratch / "a");
    file.write("new");
    file.keep();
    EXPECT_EQ(files_below(scratch / ""), (Files{{"a", "new"}}));
}

TEST(WholeFile, NamesOfPartialFilesCannotBeGuessedButRecognised) {
    const Scratch scratch;
    std::set<std::string> names;
    for (int i = 0; i < 100; ++i) {
        const WholeFile file(scratch / "a.b.png");
        const std::string name = file.partial().filename().string();
        EXPECT_EQ(complete_name(name), "a.b.png");
        names.insert(name);
    }
    EXPECT_EQ(names.size(), 100u);
    for (const char* other :
         {".x.partial", ".a.png.77.partial", "a.png.0123456789abcdef.partial",
          ".a.png.0123456789abcdeg.partial", ".a.png.0123456789abcdef", "..partial", ""})
        EXPECT_EQ(complete_name(other), "") << other;
}

TEST(WholeFile, LeavesNothingWhereItCannotTakeItsName) {
    const Scratch scratch;
    fs::create_directories(scratch / "a/b");
    {
        WholeFile file(scratch / "a");
        file.write("x");
        EXPECT_THROW(file.keep(), std::system_error);
    }
    EXPECT_EQ(files_below(scratch / ""), Files());
}

TEST(WholeFile, ManyAreOnTheDiskBeforeTheFirstTakesItsName) {
    const Scratch scratch;
    std::vector<WholeFile> files;
    for (const char* name : {"a", "b", "c"}) files.emplace_back(scratch / name).write(name);
    keep_all(files, [&] { EXPECT_FALSE(fs::exists(scratch / "a")); });
    EXPECT_EQ(files_below(scratch / ""), (Files{{"a", "a"}, {"b", "b"}, {"c", "c"}}));
}

TEST(WritingWhole, FollowsLinksAndKeepsThem) {
    const Scratch scratch;
    write_text(scratch / "target", "old");
    fs::create_symlink("target", scratch / "link");
    write_whole(scratch / "link", "new");
    EXPECT_TRUE(fs::is_symlink(scratch / "link"));
    EXPECT_EQ(text_of(scratch / "target"), "new");
}

TEST(WritingWhole, WritesToPipesAndDevicesAsTheyAre) {
    const Scratch scratch;
    write_whole("/dev/null", "gone");
    EXPECT_TRUE(fs::is_character_file("/dev/null"));
    const fs::path pipe = scratch / "pipe";
    ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
    EXPECT_TRUE(has(refusal([&] { write_whole(pipe, "nothing"); }), "nobody reads this pipe"));
    // More than a pipe holds at a time.
    const std::string data(1 << 20, 'x');
    const int reading = ::open(pipe.c_str(), O_RDONLY | O_NONBLOCK);
    ASSERT_GE(reading, 0);
    ASSERT_EQ(fcntl(reading, F_SETFL, 0), 0);
    std::string read;
    std::thread reader([&] {
        char part[4096];
        while (read.size() < data.size()) {
            const ssize_t got = ::read(reading, part, sizeof part);
            if (got > 0) read.append(part, static_cast<std::size_t>(got));
        }
    });
    write_whole(pipe, data);
    reader.join();
    ::close(reading);
    EXPECT_TRUE(read == data);
    EXPECT_TRUE(fs::is_fifo(pipe));
}

TEST(ReadingWhole, IsOfFilesAndBounded) {
    const Scratch scratch;
    write_text(scratch / "a", std::string(100000, 'x'));
    EXPECT_EQ(read_whole(scratch / "a").size(), 100000u);
    EXPECT_EQ(refusal([&] { read_whole(scratch / "a", 99999); }),
              (scratch / "a").string() + " has 100000 bytes, expected at most 99999");
    ASSERT_EQ(mkfifo((scratch / "pipe").c_str(), 0600), 0);
    EXPECT_TRUE(has(refusal([&] { read_whole(scratch / "pipe"); }),
                    "is a pipe or a device, expected a file"));
    EXPECT_THROW(read_whole(scratch / "none"), std::system_error);
    EXPECT_THROW(read_whole(scratch / ""), std::system_error);
    EXPECT_FALSE(read_whole("/proc/self/stat").empty());  // whose size says 0
}

}  // namespace
}  // namespace xcalib

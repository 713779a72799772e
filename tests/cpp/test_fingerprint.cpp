#include <gtest/gtest.h>

#include <fstream>

#include "xcalib/footage/fingerprint.hpp"

namespace xcalib {
namespace {

namespace fs = std::filesystem;

Rig some_rig() {
    Rig rig;
    rig.reference = rig.source = {640, 480, 500, 500, 319.5, 239.5};
    return rig;
}

TEST(Fingerprint, EveryByteAndItsPlaceCount) {
    const std::string text = "visible/0001.png 1234 5.000000001";
    EXPECT_EQ(fingerprint(text).size(), 16u);
    EXPECT_EQ(fingerprint(text), fingerprint(std::string(text)));
    for (std::size_t i = 0; i < text.size(); ++i) {
        std::string other = text;
        other[i] = static_cast<char>(other[i] + 1);
        EXPECT_NE(fingerprint(other), fingerprint(text)) << i;
    }
    EXPECT_NE(fingerprint("ab"), fingerprint("ba"));
    EXPECT_NE(fingerprint(""), fingerprint(std::string(1, '\0')));
}

TEST(Fingerprint, EveryNumberOfARigCounts) {
    const Rig rig = some_rig();
    EXPECT_EQ(fingerprint(rig), fingerprint(some_rig()));
    Rig other = rig;
    other.source.cx = std::nextafter(other.source.cx, 1000.0);
    EXPECT_NE(fingerprint(other), fingerprint(rig));
    other = rig;
    other.source_from_reference.translation.z() = 1e-9;
    EXPECT_NE(fingerprint(other), fingerprint(rig));
    other = rig;
    other.relative_depth = RelativeDepth{1.0, 0.0};
    EXPECT_NE(fingerprint(other), fingerprint(rig));
}

TEST(Fingerprint, PathsAreFromTheRootAsTheUserGaveThem) {
    EXPECT_EQ(absolute_path("/a//b/./c/"), "/a/b/c");
    EXPECT_EQ(absolute_path("/a/../b"), "/a/../b");
    EXPECT_EQ(absolute_path("x/"), fs::current_path() / "x");
}

TEST(Fingerprint, AStampChangesWithTheFile) {
    const fs::path folder = fs::path(::testing::TempDir()) / "xcalib_fingerprint";
    fs::create_directories(folder);
    const fs::path file = folder / "a";
    std::ofstream(file) << "one";
    const auto before = file_stamp(file);
    ASSERT_EQ(before.size(), 2u);
    EXPECT_EQ(before[0], file.string());
    EXPECT_EQ(file_stamp(file), before);
    fs::last_write_time(file, fs::last_write_time(file) + std::chrono::nanoseconds(1));
    EXPECT_NE(file_stamp(file), before);
    const auto alone = file_stamp(folder);
    std::ofstream(folder / "b") << "two";
    EXPECT_EQ(file_stamp(folder).size(), alone.size() + 1);
    EXPECT_EQ(file_stamp(folder / "none"), std::vector{(folder / "none").string()});
    fs::remove_all(folder);
}

}  // namespace
}  // namespace xcalib

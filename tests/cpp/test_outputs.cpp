#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>

#include "refusal.hpp"
#include "streams.hpp"
#include "xcalib/stream/outputs.hpp"

namespace xcalib {
namespace {

using namespace testing;
namespace fs = std::filesystem;

class Apart : public ::testing::Test {
   protected:
    Apart() {
        for (const char* name : {"v/0.png", "t/0.png", "d/0.npy", "rig.yaml", "w.mkv"})
            write_text(scratch / name, name);
    }
    std::string said(const std::vector<std::string>& files,
                     const std::vector<std::string>& folders = {}) const {
        Writes writes;
        for (const std::string& name : files) writes.files.push_back(path(name));
        for (const std::string& name : folders) writes.folders.push_back(scratch / name);
        std::vector<std::string> reads = {""};  // a file that was not given
        for (const char* name : {"v/0.png", "t/0.png", "d/0.npy", "rig.yaml", "w.mkv", "bag"})
            reads.push_back(path(name));
        return refusal([&] { check_apart(reads, writes); });
    }
    std::string path(const std::string& name) const { return (scratch / name).string(); }

    Scratch scratch;
};

TEST_F(Apart, NewFilesAndOthersAreWrittenTo) {
    write_text(scratch / "report.json", "old");
    EXPECT_EQ(said({"new.yaml", "report.json", "v/other.png", "deep/new/x.json"}, {"out", "."}),
              "");
}

TEST_F(Apart, InputsAreNotHoweverTheyAreCalled) {
    EXPECT_EQ(said({"v/0.png"}),
              path("v/0.png") + " would be overwritten, but is an input; expected another output");
    EXPECT_TRUE(has(said({"v/../rig.yaml"}), "but is an input (" + path("rig.yaml") + ")"));
    fs::create_symlink(scratch / "w.mkv", scratch / "link.mkv");
    fs::create_hard_link(scratch / "w.mkv", scratch / "hard.mkv");
    for (const char* name : {"w.mkv", "link.mkv", "hard.mkv"})
        EXPECT_TRUE(has(said({name}), "is an input")) << name;
}

TEST_F(Apart, FoldersOfInputsAreNotFilled) {
    for (const char* name : {"v", "t", "d", "v/", "t/../d"})
        EXPECT_EQ(said({}, {name}),
                  "output folder " + path(name) + " is an input folder, expected another");
    fs::create_directory_symlink(scratch / "t", scratch / "link");
    EXPECT_TRUE(has(said({}, {"out", "link"}), "is an input folder"));
}

TEST_F(Apart, WhatIsInABagIsAnInput) {
    write_text(scratch / "bag/metadata.yaml", "x");
    EXPECT_TRUE(has(said({"bag/metadata.yaml"}), "is an input"));
    EXPECT_TRUE(has(said({}, {"bag"}), "is an input folder"));
    EXPECT_EQ(said({"bag/new.json"}), "");
}

TEST_F(Apart, NothingIsWrittenTwice) {
    EXPECT_EQ(said({"new.yaml", "new.yaml"}),
              path("new.yaml") + " would be written twice, expected another name");
    fs::create_directory_symlink(scratch / "v", scratch / "link");
    EXPECT_TRUE(has(said({"v/new.json", "link/new.json"}), "written twice"));
    write_text(scratch / "a", "");
    fs::create_hard_link(scratch / "a", scratch / "b");
    EXPECT_TRUE(has(said({"a", "b"}), "written twice"));
}

TEST_F(Apart, FramesNameTheirFilesAndTables) {
    const Frames frames{std::make_shared<PlainStream>(scratch / "v/0.png", 3),
                        std::make_shared<PlainStream>(scratch / "t/0.png", 3),
                        std::make_shared<PlainDepth>()};
    const std::vector<std::string> files = files_of(frames);
    for (const char* name : {"v/0.png", "t/0.png", "t/timestamps.csv"})
        EXPECT_EQ(std::count(files.begin(), files.end(), path(name)), 1) << name;
}

class Writable : public ::testing::Test {
   protected:
    std::string file(const fs::path& name) const {
        return refusal([&] { check_file_writable(name); });
    }
    std::string output(const fs::path& name) const {
        return refusal([&] { check_output_writable(name); });
    }
    Scratch scratch;
};

TEST_F(Writable, FilesAreNewOrReplaced) {
    write_text(scratch / "old", "old");
    fs::create_symlink(scratch / "old", scratch / "link");
    for (const char* name : {"new", "old", "link", "new/deep/file"})
        EXPECT_EQ(file(scratch / name), "") << name;
    EXPECT_EQ(file("/dev/null"), "");
    EXPECT_EQ(files_below(scratch / "").size(), 2u);  // nothing was made
}

TEST_F(Writable, NamesThatAreNoFilesAreRefused) {
    EXPECT_EQ(file(""), "cannot write to '': the name is empty, expected a file name");
    EXPECT_TRUE(has(file(scratch / "new/"), "names a folder, expected a file name"));
    fs::create_directory(scratch / "folder");
    EXPECT_TRUE(has(file(scratch / "folder"), "it is a folder"));
    fs::create_symlink(scratch / "nowhere", scratch / "dangling");
    EXPECT_TRUE(has(file(scratch / "dangling"), "a link that leads nowhere"));
    EXPECT_TRUE(has(file(scratch / "\xff.json"), "not UTF-8"));
    const int descriptor = socket(AF_UNIX, SOCK_STREAM, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    const std::string at = "/tmp/xcalib_socket_" + std::to_string(::getpid());
    std::strcpy(address.sun_path, at.c_str());
    ASSERT_EQ(bind(descriptor, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    EXPECT_TRUE(has(file(at), "a socket"));
    ::close(descriptor);
    ::unlink(at.c_str());
}

TEST_F(Writable, OutputsAreFoldersOrVideos) {
    for (const char* name : {"out", "out/", "out.v2", "o.mkv", "deep/o.MP4"})
        EXPECT_EQ(output(scratch / name), "") << name;
    EXPECT_TRUE(has(output(""), "the name is empty"));
    EXPECT_TRUE(
        has(output(scratch / "o.png"), "a video is .mp4, .avi or .mkv, a folder has another name"));
    EXPECT_TRUE(has(output("/dev/null"), "is a file, expected a folder"));
    fs::create_directory(scratch / "as.png");
    EXPECT_EQ(output(scratch / "as.png"), "");  // someone means it
    ASSERT_EQ(mkfifo((scratch / "pipe.mkv").c_str(), 0600), 0);
    EXPECT_TRUE(has(output(scratch / "pipe.mkv"), "a pipe or a device"));
    write_text(scratch / "v.mkv", "x");
    fs::create_symlink(scratch / "v.mkv", scratch / "link.mkv");
    EXPECT_TRUE(has(output(scratch / "link.mkv"), "is a link"));
}

}  // namespace
}  // namespace xcalib

// What is on the disk when the power goes: what fsync has put there, and nothing else.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "streams.hpp"
#include "xcalib/rig_file.hpp"

namespace xcalib {
namespace {

using namespace testing;
namespace fs = std::filesystem;
using Files = std::map<std::string, std::string>;

std::string path_of(int descriptor) {
    return fs::read_symlink("/proc/self/fd/" + std::to_string(descriptor)).string();
}

// The strictest of file systems: contents survive only if the file was synchronized, and names only
// if their folder was.
class Disk {
   public:
    explicit Disk(fs::path folder) : folder_(std::move(folder)) {}

    void synchronize(int descriptor) {
        struct stat about {};
        if (fstat(descriptor, &about) != 0) return;
        const fs::path path = path_of(descriptor);
        if (S_ISREG(about.st_mode)) {
            contents_[about.st_ino] = text_of(path);
        } else {
            std::map<std::string, ino_t>& names = names_[path];
            names.clear();
            for (const auto& entry : fs::directory_iterator(path))
                if (lstat(entry.path().c_str(), &about) == 0 && S_ISREG(about.st_mode))
                    names[entry.path().filename().string()] = about.st_ino;
        }
        look_(after_power_loss());
        ++losses;
    }

    // By their paths in the folder. What was never synchronized is empty.
    Files after_power_loss() const {
        Files files;
        for (const auto& [folder, names] : names_)
            for (const auto& [name, inode] : names) {
                const auto found = contents_.find(inode);
                files[fs::path(folder / name).lexically_relative(folder_).string()] =
                    found == contents_.end() ? "" : found->second;
            }
        return files;
    }

    std::function<void(const Files&)> look_ = [](const Files&) {};
    int losses = 0;

   private:
    fs::path folder_;
    std::map<ino_t, std::string> contents_;
    std::map<fs::path, std::map<std::string, ino_t>> names_;
};

Disk* disk = nullptr;

class PowerLoss : public ::testing::TestWithParam<const char*> {
   protected:
    PowerLoss() : on_disk(fs::canonical(scratch / "")) { disk = &on_disk; }
    ~PowerLoss() override { disk = nullptr; }

    Scratch scratch;
    Disk on_disk;
};
INSTANTIATE_TEST_SUITE_P(Outputs, PowerLoss, ::testing::Values("out", "out.mkv"),
                         [](const auto& info) {
                             return std::string(info.param) == "out" ? "Folder" : "Video";
                         });

// A part holds a line a frame, from frame `first` on.
bool is_run_of_lines(const std::string& text) {
    std::istringstream lines(text);
    std::string line;
    std::getline(lines, line);
    for (int value = std::stoi(line); std::getline(lines, line);)
        if (std::stoi(line) != ++value) return false;
    return !text.empty() && text.back() == '\n';
}

TEST_P(PowerLoss, LeavesNothingHalfWrittenAndNoEmptyPromise) {
    const fs::path out = fs::canonical(scratch / "") / GetParam();
    const fs::path journal_file = journal_of(out);
    on_disk.look_ = [&](const Files& files) {
        Files there = files;
        const std::string noted = journal_file.lexically_relative(fs::canonical(scratch / ""));
        std::istringstream journal(there[noted]);
        there.erase(noted);
        for (const auto& [name, text] : there) {
            if (fs::path(name).extension() == ".partial") continue;
            EXPECT_TRUE(!text.empty() && is_run_of_lines(text)) << name << ": '" << text << "'";
        }
        // A line's files have the sizes in it, or count as missing: none of another content.
        std::string line;
        std::getline(journal, line);
        while (std::getline(journal, line)) {
            const auto unit = nlohmann::json::parse(line);
            EXPECT_FALSE(unit["frames"].empty());
        }
    };
    TextCodecs codecs;
    std::vector<FrameName> names;
    for (int i = 0; i < 70; ++i)
        names.push_back({"0123456789abcd" + std::to_string(10 + i), six_digits(i)});
    {
        Journal journal(journal_file, {{"command", "test"}});
        const auto sink = open_sink(out, 25, &journal, codecs, 20);
        sink->begin(names);
        for (int i = 0; i < 70; ++i)
            sink->write(i, names[static_cast<std::size_t>(i)],
                        {plain(4, 2, i), plain(4, 2, i), Picture()});
        sink->finish(names, [] {});
    }
    EXPECT_GT(on_disk.losses, 10);
    // All is there at the end, and the journal says so.
    Files left = on_disk.after_power_loss();
    for (const auto& [name, text] : files_below(fs::canonical(scratch / "")))
        EXPECT_EQ(left[name], text) << name;
    EXPECT_EQ(Journal(journal_file, {{"command", "test"}}).units().empty(), false);
}

TEST_F(PowerLoss, LeavesTheOldRigOrTheNew) {
    Rig rig;
    rig.reference = rig.source = {16, 12, 20, 20, 7.5, 5.5};
    const fs::path file = fs::canonical(scratch / "") / "rig.yaml";
    std::set<std::string> seen;
    on_disk.look_ = [&](const Files& files) {
        if (files.count("rig.yaml")) seen.insert(files.at("rig.yaml"));
    };
    std::set<std::string> whole;
    for (const double fx : {20.0, 30.0, 40.0}) {
        rig.source.fx = fx;
        save_rig(rig, file.string());
        whole.insert(text_of(file));
    }
    EXPECT_EQ(seen, whole);
}

}  // namespace

void synchronized(int descriptor) {
    if (disk) disk->synchronize(descriptor);
}

}  // namespace xcalib

// In place of the C library's: noted, and otherwise what they are.
extern "C" int fsync(int descriptor) {
    xcalib::synchronized(descriptor);
    return 0;
}
extern "C" int fdatasync(int descriptor) { return fsync(descriptor); }

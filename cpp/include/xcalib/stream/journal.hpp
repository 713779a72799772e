// What of an output is done, so that an interrupted run can be taken up again by the command that
// began it.
//
// A text file beside the output: a line of JSON on how the output is made, then a line for each
// unit of whole files: which frames they hold, and their sizes. A line is written after its files
// are on the disk, and counts while they have that size: whatever moment a run ends at, the journal
// never promises what is not there.
#pragma once

#include <cstdint>
#include <filesystem>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "xcalib/export.hpp"

namespace XCALIB_EXPORT xcalib {

// Files that are whole only together.
struct Unit {
    std::vector<std::pair<std::string, long>> frames;  // keys, in order, and their valid pixels
    std::vector<std::pair<std::string, std::uintmax_t>> files;  // beside the journal [bytes]
};

// All that decides what an output is, apart from the frames themselves: text by name, in the order
// in which differences are named. `command` names the program: each describes its inputs in its own
// words, so that one does not go on with what another began.
using MadeWith = std::vector<std::pair<std::string, std::string>>;

// The journal of one output, held by one process at a time. Until a first file is written the file
// is empty, and goes when it is closed.
class Journal {
   public:
    // The folder is made where there is none. `overwrite`: remove what is there instead of going on
    // from it, as far as it is still what the run made, and no link. Throws InputError where what
    // is there was made otherwise, is not a journal, or another process is at it.
    Journal(std::filesystem::path path, const MadeWith& made_with, bool overwrite = false);
    // Of an output that is there, whatever it was made with.
    explicit Journal(std::filesystem::path path);
    ~Journal();
    Journal(const Journal&) = delete;
    Journal& operator=(const Journal&) = delete;

    // Those of earlier runs whose files are all there, in the size that they were written. What
    // this run notes is not kept: memory would grow with every frame.
    const std::vector<Unit>& units() const { return units_; }

    // What it says that the output was made with, by name; empty where it says nothing of that.
    std::string made_with(const std::string& name) const;

    // Whether there was none, of which a line was whole.
    bool is_new() const { return is_new_; }

    // Notes that the files of these names, beside the journal, are whole; from any thread. It is on
    // the disk then.
    void append(std::vector<std::pair<std::string, long>> frames,
                const std::vector<std::string>& files);
    void append(const std::vector<Unit>& units);

    // Before the first file has its name: from here on what is called as this output's files is of
    // runs that this journal is of, noted or not.
    void claim();

   private:
    void open();
    void close();
    // `made_with`: null for any.
    void load(const MadeWith* made_with, bool overwrite);
    void write(const std::string& data);
    void sync() const;

    std::filesystem::path path_;
    std::string first_;
    MadeWith made_with_;
    std::vector<std::filesystem::path> made_folders_;  // deepest first
    std::vector<Unit> units_;
    std::mutex mutex_;
    int descriptor_ = -1;
    bool is_new_ = true;
};

}  // namespace xcalib

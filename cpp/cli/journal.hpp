// What of an output is done, so that an interrupted run can be taken up again, by this command or
// by the Python one.
//
// A text file beside the output: a line of JSON on how the output is made, then a line for each
// unit of whole files: which frames they hold, and their sizes. A line is written after its files
// are, so that whatever moment a run ends at, the journal never promises what is not there.
#pragma once

#include <cstdint>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "files.hpp"

namespace xcalib::cli {

// Files that are whole only together.
struct Unit {
    std::vector<std::pair<std::string, long>> frames;  // keys, in order, and their valid pixels
    std::vector<std::pair<std::string, std::uintmax_t>> files;  // beside the journal [bytes]
};

// By name, in the order in which differences are told.
using MadeWith = std::vector<std::pair<std::string, std::string>>;

// The journal of one output, held by one process at a time. Until there is a first unit the file is
// empty, and goes when it is closed.
class Journal {
   public:
    // The folder is made where there is none. `made_with`: all that decides what the output is,
    // apart from the frames themselves. `overwrite`: remove what is there instead of going on from
    // it. Throws InputError where what is there was made otherwise, is not a journal, or another
    // process is at it.
    Journal(Path path, const MadeWith& made_with, bool overwrite);
    ~Journal();
    Journal(const Journal&) = delete;
    Journal& operator=(const Journal&) = delete;

    // Whose files are all there, in the size that they were written.
    const std::vector<Unit>& units() const { return units_; }

    // Notes that the files of these names are whole; from any thread.
    void append(std::vector<std::pair<std::string, long>> frames,
                const std::vector<std::string>& files);

   private:
    void open();
    void close();
    void load(const MadeWith& made_with, bool overwrite);
    void write(const std::string& line);

    Path path_;
    std::string first_;
    std::vector<Path> made_folders_;  // deepest first
    std::vector<Unit> units_;
    std::mutex mutex_;
    int descriptor_ = -1;
};

}  // namespace xcalib::cli

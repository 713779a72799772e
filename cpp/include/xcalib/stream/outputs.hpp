// What a run may write to: not its own inputs, not what others have made, not what cannot be
// written.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "xcalib/export.hpp"
#include "xcalib/stream/frames.hpp"

namespace XCALIB_EXPORT xcalib {

// Throw InputError now, before long work, if nothing can be written there. Nothing is made.
void check_folder_writable(const std::filesystem::path& folder);
void check_file_writable(const std::filesystem::path& file);
// A folder or a video, as `register` writes: no pipe, and no folder called like a file.
void check_output_writable(const std::filesystem::path& output);

// Names are strings where there are as many as frames: a path takes ten times their memory.
struct Writes {
    std::vector<std::string> files;
    std::vector<std::filesystem::path> folders;  // into which images are written, a file a frame
};

// Throws InputError where a run would write to a file that it reads, whatever either is called and
// whichever links lead there; where it would write one file twice; and where it would write images
// into a folder whose images it reads. In a folder among `reads` everything is read.
void check_apart(const std::vector<std::string>& reads, const Writes& writes);

// All files that the frames are read from.
std::vector<std::string> files_of(const Frames& frames);

// All of this for a run that reads the frames, and other files, and writes these.
void check_writes(const std::vector<std::filesystem::path>& files, const Frames& frames,
                  const std::vector<std::filesystem::path>& other_reads);

}  // namespace xcalib

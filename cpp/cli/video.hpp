// Video files, through OpenCV and the FFmpeg inside it.
#pragma once

#include "footage.hpp"

namespace xcalib::cli {

inline const std::vector<std::string> kVideoSuffixes = {".mp4",  ".m4v", ".mov",  ".avi", ".mkv",
                                                        ".webm", ".mpg", ".mpeg", ".ts",  ".wmv"};

// 8-bit colour; or gray, 8 or 16 bit, from codecs with it. Opening reads the file once, without
// converting pixels, for the number of frames and the time of each.
StreamPointer open_video(const Path& path);

// Whether a capture holds gray, which OpenCV hands out as it is stored if asked to; all other
// formats it converts to 8-bit colour.
bool holds_gray(double format_code);

}  // namespace xcalib::cli

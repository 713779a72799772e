// Which frame of the one camera belongs to which of the other: by the names of files, in order, or
// by time.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "xcalib/error.hpp"
#include "xcalib/export.hpp"

namespace XCALIB_EXPORT xcalib {

// The order in which people count: runs of digits compare as numbers (`a2` before `a10`), letters
// of ASCII without their case. Indices of the names.
std::vector<int> natural_order(const std::vector<std::string>& names);

// The frames of a camera, or its depth maps, without their pixels.
struct FrameList {
    std::vector<std::string> names;            // without suffix
    std::vector<std::filesystem::path> paths;  // of the files; empty where frames are none
    std::optional<std::vector<double>> times;  // [s], never falling
    std::vector<std::string> where;            // for messages: a file, or a file and a number
};

// The partner in `second` of each file of `first`; neither is empty.
// 1. Files of the same stem belong together (`00007.png` and `00007.tiff`).
// 2. If no stem is common, files with the same numbers in their names do
//    (`FLIR_00007_Z` and `FLIR_00007_T`), or with the same index behind a stamp
//    (`DJI_20240131120001_0007_T` and `DJI_20240131120002_0007_V`).
// 3. If no number is common either, their order decides, of as many.
// Throws InputError, naming what has no partner, where names agree only in part: a frame is missing
// somewhere, and order would pair every later one with a stranger.
std::vector<int> pair_files(const std::vector<std::filesystem::path>& first,
                            const std::vector<std::filesystem::path>& second);

// [s] where every name holds one time since 1970 (19, 16 or 13 digits of nano-, micro- or
// milliseconds, seconds with a fraction, SEC_NSEC, or a date and a time of day with a fraction) and
// they rise; none otherwise. Plain seconds could be any number, and so are not taken for times.
std::optional<std::vector<double>> times_of_names(const std::vector<std::string>& names);

// [s] of each name, from the text of a table of `name timestamp` lines: names with or without
// suffix, then a comma, semicolon or blanks. Lines of other kinds may only come first, `#` comments
// anywhere. Throws InputError that begins with `table`, the file's name.
std::vector<double> times_of_table(const std::string& text, const std::string& table,
                                   const std::vector<std::string>& names);

// [s] of the lines of a table without names, `timestamp` or `2011-09-26 13:02:25.964` (KITTI's), in
// its order; none where there are lines of another kind, but for a header.
std::vector<double> times_in_order(const std::string& text);

// Median distance of frames [s]; 0 for a single one.
double median_period(const std::vector<double>& times);

struct Pairing {
    std::string method;                    // name, order or time
    std::vector<int> references, sources;  // as many of each, in the order of the references
    int dropped_references = 0, dropped_sources = 0;  // frames without a partner
    double gap = 0.0;     // median distance in time, the offset allowed for [s]
    double offset = 0.0;  // by how much the source's clock is late [s]
    int lag = 0;          // by how many of its frames the source is late beyond that
    std::string alone;    // files without a partner, by name; a few of them

    std::string line() const;  // what happened
};

// Nearest times, one to one and in order, at most `max_gap` apart [s] (by default half the larger
// median period). The frames of the stream with fewer of them choose, one after the other, among
// the frames behind the last one chosen; of those of one time only the first. Throws InputError
// where no two are near.
Pairing pair_times(const std::vector<double>& references, const std::vector<double>& sources,
                   double offset = 0.0, std::optional<double> max_gap = std::nullopt);

// Files of two cameras by their names, as pair_files() does, but for a few that are alone: these
// are left out. Throws InputError where more than a tenth are.
Pairing pair_names(const std::vector<std::filesystem::path>& first,
                   const std::vector<std::filesystem::path>& second);

// How frames are paired.
inline constexpr std::array kPairingMethods = {"auto", "name", "order", "time"};

// `method`: name (pair_names), order (first with first, of equally many), time (pair_times), or
// auto: by time where both have times, else files by name, and others in order. `offset` [s]:
// reference time t is source time t + offset; not 0: by time. Throws InputError.
Pairing pair_frames(const FrameList& references, const FrameList& sources,
                    const std::string& method = "auto", double offset = 0.0,
                    std::optional<double> max_gap = std::nullopt);

// The depth map of each of the references `used`. Files under the names of the frames are theirs,
// and others are left over. Else the nearest in time within half a period of the references, where
// both have times; else by pair_files, of all references or of those in use. Throws InputError.
std::vector<int> match_depths(const FrameList& references, const std::vector<int>& used,
                              const FrameList& depths);

// The second of these ways: `depths` are times [s], `where` names them in the InputError.
std::vector<int> nearest_depths(const FrameList& references, const std::vector<int>& used,
                                const std::vector<double>& depths, const std::string& where);

}  // namespace xcalib

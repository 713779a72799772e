// Image files that say how their picture is to be turned, see exif.hpp.
#pragma once

#include <string>

#include "xcalib/export.hpp"
#include "xcalib/stream/stream.hpp"

namespace XCALIB_EXPORT xcalib {

// The picture turned and mirrored as an EXIF orientation, 1 to 8, asks for.
Picture oriented(const Picture& picture, int orientation);

// A stream of image files, each turned as it asks for; another stream as it is.
StreamPointer oriented(StreamPointer stream);

// A line where the first file of the stream asks for a turn, or an empty one. `applied`: whether
// it is turned.
std::string orientation_line(const Stream& stream, bool applied);

}  // namespace xcalib

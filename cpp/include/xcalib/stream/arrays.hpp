// Files of arrays besides .npy: .npz, numpy's archives of them, and .pfm, floats of stereo methods.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "xcalib/export.hpp"
#include "xcalib/stream/npy.hpp"
#include "xcalib/stream/picture.hpp"

namespace XCALIB_EXPORT xcalib {

// What a .npy, .npz or .pfm file has; none where the suffix is another.
std::optional<Picture> read_array(const std::filesystem::path& file, ArrayKind kind);

// The .npy file in an archive: the only one, or the one named depth, disparity, or arr_0. Throws
// DecodeError where it is damaged, InputError where none is meant.
std::string npy_of_npz(const std::string& data, const std::string& name);

// One channel of floats, top row first, whatever the order of the file. Throws DecodeError.
Picture parse_pfm(const std::string& data, const std::string& name);

}  // namespace xcalib

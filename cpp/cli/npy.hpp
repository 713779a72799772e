// numpy's file format, as far as depth maps need it.
#pragma once

#include <opencv2/core.hpp>

#include "pictures.hpp"

namespace xcalib::cli {

// A (h, w) or (h, w, 1) array of float16, float32 or float64, as float32. Throws DecodeError where
// it is no array, InputError where it is another one.
cv::Mat read_npy(const Path& file);

}  // namespace xcalib::cli

// Image files in and out.
#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "xcalib/error.hpp"
#include "xcalib/stream/picture.hpp"

namespace xcalib::cli {

using Path = std::filesystem::path;

inline const std::vector<std::string> kImageSuffixes = {".png", ".jpg", ".jpeg", ".tif",  ".tiff",
                                                        ".bmp", ".pgm", ".ppm",  ".webp", ".jp2"};
inline const std::vector<std::string> kArraySuffixes = {".npy"};

// The image files of a folder; arrays where it has no other, for they may lie beside images.
std::vector<Path> list_images(const Path& folder);

// The pixels of a matrix of 1 or 3 channels, uint8, uint16 or float32.
ImageView view_of(const cv::Mat& pixels);
ImageView view_of(const cv::Mat&& pixels) = delete;
// The same, which keeps them.
Picture picture_of(const cv::Mat& pixels);
// A view as OpenCV sees it, without a copy; nothing may be written to it.
cv::Mat mat_of(const ImageView& image);

// One image, 1 or 3 channels (an alpha channel is dropped), uint8, uint16 or float32, as it is
// stored: no rotation by EXIF tags, for a camera's geometry is that of its sensor.
cv::Mat read_image(const Path& file);

// The same of decoded pixels; `where` names them in an InputError.
cv::Mat as_image(cv::Mat pixels, const std::string& where);

// As numpy calls OpenCV's type of a channel.
std::string type_name(int depth);

// All channels as they are. Throws DecodeError.
cv::Mat decode(const Path& file);
// The same of the bytes of a file; `name` names it in messages.
cv::Mat decode_bytes(std::string data, const std::string& name);

// A file of the kind that the suffix says.
std::string encode_image(const Path& file, const ImageView& image);

}  // namespace xcalib::cli

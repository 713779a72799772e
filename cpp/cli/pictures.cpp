#include "pictures.hpp"

#include <algorithm>
#include <cstdint>
#include <opencv2/imgcodecs.hpp>
#include <string_view>

#include "xcalib/footage/exif.hpp"
#include "xcalib/stream/files.hpp"
#include "xcalib/stream/tiff.hpp"

namespace xcalib::cli {
namespace {

PixelType type_of(const cv::Mat& pixels) {
    switch (pixels.depth()) {
        case CV_8U: return PixelType::u8;
        case CV_16U: return PixelType::u16;
        default: return PixelType::f32;
    }
}

// Whether a PNG or JPEG ends early: OpenCV would return it with a gray or black rest.
bool is_truncated(std::string_view data) {
    using namespace std::string_view_literals;
    if (data.substr(0, 4) == "\x89PNG"sv)
        return data.find("\0\0\0\0IEND\xae\x42\x60\x82"sv) == std::string_view::npos;
    if (data.substr(0, 2) != "\xff\xd8"sv) return false;
    // Walk the segments to the scan: thumbnails inside them have end markers of their own. In the
    // scan a byte FF is always escaped, so that FF D9 is the end and nothing else.
    std::size_t at = 2;
    while (at + 4 <= data.size() && data[at] == '\xff' && data[at + 1] != '\xda')
        at += 2 + (static_cast<std::uint8_t>(data[at + 2]) << 8 |
                   static_cast<std::uint8_t>(data[at + 3]));
    return at >= data.size() || data.find("\xff\xd9"sv, at) == std::string_view::npos;
}

}  // namespace

ImageView view_of(const cv::Mat& pixels) {
    return {pixels.data,       pixels.cols,     pixels.rows,
            pixels.channels(), type_of(pixels), static_cast<std::ptrdiff_t>(pixels.step[0])};
}

Picture picture_of(const cv::Mat& pixels) {
    const auto owner = std::make_shared<const cv::Mat>(pixels);
    return {view_of(*owner), owner};
}

cv::Mat mat_of(const ImageView& image) {
    const int depth = image.type == PixelType::u8    ? CV_8U
                      : image.type == PixelType::u16 ? CV_16U
                                                     : CV_32F;
    return {image.height, image.width, CV_MAKETYPE(depth, image.channels),
            const_cast<void*>(image.data), static_cast<std::size_t>(image.row_bytes)};
}

cv::Mat as_image(cv::Mat pixels, const std::string& where) {
    if (pixels.channels() == 2) cv::extractChannel(pixels, pixels, 0);
    if (pixels.channels() == 4) {
        cv::Mat colour(pixels.size(), CV_MAKETYPE(pixels.depth(), 3));
        cv::mixChannels({pixels}, {colour}, {0, 0, 1, 1, 2, 2});
        pixels = colour;
    }
    if (pixels.depth() != CV_8U && pixels.depth() != CV_16U && pixels.depth() != CV_32F) {
        static const char* const kNames[] = {"uint8", "int8",    "uint16",  "int16",
                                             "int32", "float32", "float64", "float16"};
        throw InputError(where + ": pixels are " + kNames[pixels.depth()] +
                         ", expected uint8, uint16 or float32");
    }
    return pixels;
}

cv::Mat read_image(const Path& file) {
    cv::Mat pixels = decode(file);
    if (pixels.depth() == CV_64F) pixels.convertTo(pixels, CV_32F);
    return as_image(pixels, file.string());
}

cv::Mat decode(const Path& file) {
    if (!std::filesystem::is_regular_file(file)) throw InputError(file.string() + ": no such file");
    std::string data = read_file(file);
    forget_tiff_orientation(data);
    cv::Mat pixels;
    if (!data.empty() && !is_truncated(data)) {
        try {
            const cv::Mat bytes(1, static_cast<int>(data.size()), CV_8U, data.data());
            pixels = cv::imdecode(bytes, cv::IMREAD_UNCHANGED);
        } catch (const cv::Exception&) {
            pixels.release();
        }
    }
    const std::string type = pixels.empty() ? tiff_pixel_type(data) : "";
    if (!type.empty() && type != "uint8" && type != "uint16" && type != "float32")
        throw InputError(file.string() + ": pixels are " + type +
                         ", expected uint8, uint16 or float32");
    if (pixels.empty())
        throw DecodeError(file.string() + ": cannot decode " + std::to_string(data.size()) +
                          " bytes, truncated or not an image");
    return pixels;
}

std::string encode_image(const Path& file, const ImageView& image) {
    std::vector<std::uint8_t> data;
    if (!cv::imencode(file.extension().string(), mat_of(image), data))
        throw std::runtime_error(file.string() + ": cannot encode " + size_text(image));
    return {data.begin(), data.end()};
}

}  // namespace xcalib::cli

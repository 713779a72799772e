#include "pictures.hpp"

#include <algorithm>
#include <cstdint>
#include <opencv2/imgcodecs.hpp>
#include <string_view>

#include "xcalib/footage/exif.hpp"
#include "xcalib/stream/arrays.hpp"
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

// Doubles of what was decoded as signed but is not.
cv::Mat unsigned_of(const cv::Mat& counts) {
    cv::Mat numbers(counts.size(), CV_64F);
    for (int y = 0; y < counts.rows; ++y)
        for (int x = 0; x < counts.cols; ++x)
            numbers.at<double>(y, x) = static_cast<std::uint32_t>(counts.at<std::int32_t>(y, x));
    return numbers;
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

std::vector<Path> list_images(const Path& folder) {
    std::vector<std::string> every = kImageSuffixes;
    every.insert(every.end(), kArraySuffixes.begin(), kArraySuffixes.end());
    std::vector<Path> files = list_files(folder, every), images;
    for (const Path& file : files)
        if (lower_suffix(file) != kArraySuffixes[0]) images.push_back(file);
    return images.empty() ? files : images;
}

cv::Mat as_image(cv::Mat pixels, const std::string& where) {
    if (pixels.channels() == 2) cv::extractChannel(pixels, pixels, 0);
    if (pixels.channels() == 4) {
        cv::Mat colour(pixels.size(), CV_MAKETYPE(pixels.depth(), 3));
        cv::mixChannels({pixels}, {colour}, {0, 0, 1, 1, 2, 2});
        pixels = colour;
    }
    if (pixels.depth() == CV_32S) pixels.convertTo(pixels, CV_32F);
    if (pixels.depth() != CV_8U && pixels.depth() != CV_16U && pixels.depth() != CV_32F)
        throw InputError(where + ": pixels are " + type_name(pixels.depth()) +
                         ", expected uint8, uint16 or float32");
    return pixels;
}

std::string type_name(int depth) {
    static const char* const kNames[] = {"uint8", "int8",    "uint16",  "int16",
                                         "int32", "float32", "float64", "float16"};
    return kNames[depth];
}

cv::Mat read_image(const Path& file) {
    if (const auto array = read_array(file, ArrayKind::image)) return mat_of(array->view).clone();
    cv::Mat pixels = decode(file);
    if (pixels.depth() == CV_64F) pixels.convertTo(pixels, CV_32F);
    return as_image(pixels, file.string());
}

cv::Mat decode(const Path& file) {
    if (!std::filesystem::is_regular_file(file)) {
        if (std::filesystem::is_symlink(file))
            throw DecodeError(file.string() + ": a link to a file that is not there");
        throw InputError(file.string() + ": no such file");
    }
    return decode_bytes(read_file(file), file.string());
}

cv::Mat decode_bytes(std::string data, const std::string& name) {
    forget_tiff_orientation(data);
    put_full_page_first(data, name);
    const bool is_unsigned = put_as_signed(data);
    cv::Mat pixels;
    if (!data.empty() && !is_truncated(data)) {
        try {
            const cv::Mat bytes(1, static_cast<int>(data.size()), CV_8U, data.data());
            pixels = cv::imdecode(bytes, cv::IMREAD_UNCHANGED);
        } catch (const std::exception&) {  // of OpenCV; of memory, for a size that is claimed
            pixels.release();
        }
    }
    const std::string type = pixels.empty() ? tiff_pixel_type(data) : "";
    if (!type.empty() && type != "uint8" && type != "uint16" && type != "float32")
        throw InputError(name + ": pixels are " + type + ", expected uint8, uint16 or float32");
    if (pixels.empty())
        throw DecodeError(name + ": cannot decode " + std::to_string(data.size()) +
                          " bytes, truncated or not an image");
    if (is_unsigned && pixels.type() == CV_32SC1) pixels = unsigned_of(pixels);
    return pixels;
}

std::string encode_image(const Path& file, const ImageView& image) {
    std::vector<std::uint8_t> data;
    if (!cv::imencode(file.extension().string(), mat_of(image), data))
        throw std::runtime_error(file.string() + ": cannot encode " + size_text(image));
    return {data.begin(), data.end()};
}

}  // namespace xcalib::cli

#include "capture.hpp"

#include <algorithm>

#include "pictures.hpp"
#include "video.hpp"
#include "xcalib/error.hpp"

namespace xcalib::cli {

Capture::Capture(const std::string& source) : source_(source) {
    const bool is_index =
        !source.empty() && source.size() < 5 &&
        std::all_of(source.begin(), source.end(), [](char c) { return c >= '0' && c <= '9'; });
    try {
        if (is_index) capture_.open(std::stoi(source));
        else capture_.open(source);
    } catch (const cv::Exception&) {
    }
    if (!capture_.isOpened())
        throw InputError(source +
                         ": OpenCV cannot open it, expected the index of a camera, or a"
                         " device, URL, file or GStreamer pipeline");
    // Thermal cameras send gray, often of 16 bits, which a conversion to colour would cut.
    if (holds_gray(capture_.get(cv::CAP_PROP_CODEC_PIXEL_FORMAT)) ||
        holds_gray(capture_.get(cv::CAP_PROP_FOURCC)))
        capture_.set(cv::CAP_PROP_CONVERT_RGB, 0);
    // A frame that waits is one that is late.
    capture_.set(cv::CAP_PROP_BUFFERSIZE, 1);
}

cv::Mat Capture::retrieve() {
    cv::Mat image;
    if (!capture_.retrieve(image)) throw std::runtime_error(source_ + ": cannot decode a frame");
    return as_image(image.clone(), source_);
}

}  // namespace xcalib::cli

// Our images as OpenCV sees them, without a copy.
#pragma once

#include <opencv2/imgproc.hpp>

#include "xcalib/image.hpp"

namespace xcalib {

inline cv::Mat as_mat(const Image& image) {
    return {image.height, image.width, CV_32FC1, const_cast<float*>(image.pixels.data())};
}

inline cv::Mat blurred(const cv::Mat& map, double sigma) {
    cv::Mat out;
    cv::GaussianBlur(map, out, cv::Size(), sigma, sigma, cv::BORDER_REFLECT_101);
    return out;
}

}  // namespace xcalib

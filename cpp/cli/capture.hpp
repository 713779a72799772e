// A camera, or whatever OpenCV opens as one.
#pragma once

#include <opencv2/videoio.hpp>
#include <string>

namespace xcalib::cli {

class Capture {
   public:
    // An index of V4L2, a device, a URL, a file, a pattern of images, a GStreamer pipeline.
    // Throws InputError where it cannot be opened.
    explicit Capture(const std::string& source);

    bool grab() { return capture_.grab(); }  // false at its end
    cv::Mat retrieve();                      // gray where the camera is, 8 or 16 bit

   private:
    std::string source_;
    cv::VideoCapture capture_;
};

}  // namespace xcalib::cli

// Depth maps from a pipe or a socket: what a driver of a lidar or a time-of-flight camera writes.
//
// Each map is a header of 32 bytes and its pixels, row by row from the top left, without gaps; all
// numbers are little-endian:
//
//     bytes  0- 3   "XCDP"
//     bytes  4- 7   uint32  width [px], 1 to 16384
//     bytes  8-11   uint32  height [px], 1 to 16384
//     bytes 12-15   uint32  type of the pixels: 1 uint16, 2 float32
//     bytes 16-23   float64 metres per unit of a pixel, > 0 (1 for float32 in metres)
//     bytes 24-31   uint64  time stamp [us] on any clock, repeated in the `frame` event
//
// Depth is along the optical axis of the reference camera, registered to its pixels; 0, negative,
// NaN and inf are unknown. The aspect is that of the reference image, the size is free.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <opencv2/core.hpp>
#include <optional>
#include <thread>

namespace xcalib::cli {

struct DepthMap {
    cv::Mat depth;  // float32 [m]
    std::uint64_t timestamp_us = 0;
};

class DepthStream {
   public:
    explicit DepthStream(int fd);  // does not own it
    ~DepthStream();

    // The next map that has not been asked for, none at the end. Waits.
    std::optional<DepthMap> next();

    // The last map that has come; waits for the first. None at the end: the map before it says
    // nothing of now.
    std::optional<DepthMap> latest();

   private:
    void run();
    bool read_exactly(void* data, std::size_t size, bool may_end);
    std::optional<DepthMap> read_map();

    int fd_;
    int wake_[2];  // a pipe that ends the wait for bytes
    std::mutex mutex_;
    std::condition_variable changed_;
    std::deque<DepthMap> maps_;  // come and not asked for, the newest last
    bool keep_all_ = true;
    bool ended_ = false, stopped_ = false;
    std::exception_ptr error_;
    std::thread thread_;
};

}  // namespace xcalib::cli

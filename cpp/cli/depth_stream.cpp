#include "depth_stream.hpp"

#include <poll.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <string>
#include <system_error>

#include "console.hpp"
#include "xcalib/error.hpp"
#include "xcalib/stream/interrupts.hpp"

namespace xcalib::cli {
namespace {

constexpr std::size_t kWaiting = 8;  // maps held for a slower reader; then the pipe fills up
constexpr std::uint32_t kLargest = 16384;

template <class Number>
Number little_endian(const std::uint8_t* bytes) {
    std::uint64_t bits = 0;
    for (std::size_t i = 0; i < sizeof(Number); ++i) bits |= std::uint64_t{bytes[i]} << (8 * i);
    Number value;
    if constexpr (sizeof(Number) == 8) {
        std::memcpy(&value, &bits, 8);
    } else {
        value = static_cast<Number>(bits);
    }
    return value;
}

}  // namespace

DepthStream::DepthStream(int fd) : fd_(fd) {
    if (pipe(wake_) != 0) throw std::system_error(errno, std::generic_category(), "pipe");
    thread_ = std::thread([this] { run(); });
}

DepthStream::~DepthStream() {
    {
        const std::lock_guard lock(mutex_);
        stopped_ = true;
    }
    changed_.notify_all();
    if (write(wake_[1], "", 1) < 0) {
        // The thread then ends with the stream.
    }
    thread_.join();
    close(wake_[0]);
    close(wake_[1]);
}

void DepthStream::run() {
    try {
        while (std::optional<DepthMap> map = read_map()) {
            std::unique_lock lock(mutex_);
            changed_.wait(lock, [&] { return stopped_ || !keep_all_ || maps_.size() < kWaiting; });
            if (stopped_) break;
            if (!keep_all_) maps_.clear();
            maps_.push_back(std::move(*map));
            changed_.notify_all();
        }
    } catch (...) {
        const std::lock_guard lock(mutex_);
        error_ = std::current_exception();
    }
    const std::lock_guard lock(mutex_);
    ended_ = true;
    changed_.notify_all();
}

// False at the end of the stream, where that may be here.
bool DepthStream::read_exactly(void* data, std::size_t size, bool may_end) {
    auto* at = static_cast<char*>(data);
    for (std::size_t done = 0; done < size;) {
        pollfd waiting[2] = {{fd_, POLLIN, 0}, {wake_[0], POLLIN, 0}};
        if (poll(waiting, 2, -1) < 0 && errno != EINTR)
            throw std::system_error(errno, std::generic_category(),
                                    "--depth-fd " + std::to_string(fd_));
        if (waiting[1].revents) return false;
        if (!waiting[0].revents) continue;
        const ssize_t got = read(fd_, at + done, size - done);
        if (got < 0 && errno != EINTR && errno != EAGAIN)
            throw std::system_error(errno, std::generic_category(),
                                    "--depth-fd " + std::to_string(fd_));
        if (got == 0) {
            if (done == 0 && may_end) return false;
            throw InputError("--depth-fd " + std::to_string(fd_) +
                             ": the stream ends inside of a depth map");
        }
        if (got > 0) done += static_cast<std::size_t>(got);
    }
    return true;
}

std::optional<DepthMap> DepthStream::read_map() {
    const std::string where = "--depth-fd " + std::to_string(fd_) + ": ";
    std::array<std::uint8_t, 32> header{};
    if (!read_exactly(header.data(), header.size(), true)) return std::nullopt;
    if (std::memcmp(header.data(), "XCDP", 4) != 0)
        throw InputError(where + "no header where one was expected (\"XCDP\")");
    const auto width = little_endian<std::uint32_t>(&header[4]);
    const auto height = little_endian<std::uint32_t>(&header[8]);
    const auto type = little_endian<std::uint32_t>(&header[12]);
    const auto scale = little_endian<double>(&header[16]);
    if (width < 1 || height < 1 || width > kLargest || height > kLargest)
        throw InputError(where + "depth is " + std::to_string(width) + "x" +
                         std::to_string(height) + ", expected 1 to 16384 px");
    if (type != 1 && type != 2)
        throw InputError(where + "type is " + std::to_string(type) +
                         ", expected 1 (uint16) or 2 (float32)");
    if (!(scale > 0 && std::isfinite(scale)))
        throw InputError(where + "scale is " + std::to_string(scale) +
                         ", expected metres per unit, > 0");
    DepthMap map;
    map.timestamp_us = little_endian<std::uint64_t>(&header[24]);
    cv::Mat pixels(static_cast<int>(height), static_cast<int>(width),
                   type == 1 ? CV_16UC1 : CV_32FC1);
    if (!read_exactly(pixels.data, pixels.total() * pixels.elemSize(), false)) return std::nullopt;
    pixels.convertTo(map.depth, CV_32F, scale);
    return map;
}

std::optional<DepthMap> DepthStream::next() {
    std::unique_lock lock(mutex_);
    while (!changed_.wait_for(lock, std::chrono::milliseconds(100),
                              [&] { return ended_ || !maps_.empty(); }))
        if (interrupted()) return std::nullopt;
    if (maps_.empty()) {
        if (error_) std::rethrow_exception(error_);
        return std::nullopt;
    }
    DepthMap map = std::move(maps_.front());
    maps_.pop_front();
    changed_.notify_all();
    return map;
}

std::optional<DepthMap> DepthStream::latest() {
    std::unique_lock lock(mutex_);
    keep_all_ = false;
    changed_.notify_all();
    while (!changed_.wait_for(lock, std::chrono::milliseconds(100),
                              [&] { return ended_ || !maps_.empty(); }))
        if (interrupted()) return std::nullopt;
    if (ended_) {
        if (error_) std::rethrow_exception(error_);
        return std::nullopt;
    }
    return maps_.back();
}

}  // namespace xcalib::cli

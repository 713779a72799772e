// Where the time of a calibration goes, as it is added up while it runs.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>

#include "xcalib/calibration_times.hpp"

namespace xcalib {

using Clock = std::chrono::steady_clock;

inline std::int64_t nanoseconds_since(Clock::time_point start) {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now() - start).count();
}

struct WorkTimes {
    std::atomic<std::int64_t> prepare{0}, solver{0};           // of the calling thread [ns]
    std::atomic<std::int64_t> warp{0}, value{0}, jacobian{0};  // of all threads [ns]

    CalibrationTimes seconds(int num_threads) const {
        CalibrationTimes out;
        out.prepare = 1e-9 * static_cast<double>(prepare);
        out.solver = 1e-9 * static_cast<double>(solver);
        out.warp = 1e-9 * static_cast<double>(warp) / num_threads;
        out.value = 1e-9 * static_cast<double>(value) / num_threads;
        out.jacobian = 1e-9 * static_cast<double>(jacobian) / num_threads;
        return out;
    }
};

// The clock of one pass over an image pair: what is not spent in `warp` is of the kind that the
// pass is of. Reading the clock takes a good part of a short row's time, so one row of kEvery
// stands for all. Without `times` nothing is kept.
class PassClock {
   public:
    PassClock(WorkTimes* times, bool derives)
        : times_(times), kind_(times ? derives ? &times->jacobian : &times->value : nullptr) {}
    ~PassClock() {
        if (!times_) return;
        const std::int64_t all = nanoseconds_since(start_);
        const std::int64_t warping = std::min(all, kEvery * warping_);
        times_->warp += warping;
        *kind_ += all - warping;
    }
    PassClock(const PassClock&) = delete;
    PassClock& operator=(const PassClock&) = delete;

    template <class Work>
    auto warp(const Work& work) {
        if (calls_++ % kEvery != 0) return work();
        struct Stop {
            PassClock& clock;
            Clock::time_point start = Clock::now();
            ~Stop() { clock.warping_ += nanoseconds_since(start); }
        } stop{*this};
        return work();
    }

   private:
    static constexpr int kEvery = 8;

    WorkTimes* times_;
    std::atomic<std::int64_t>* kind_;
    Clock::time_point start_ = Clock::now();
    std::int64_t warping_ = 0;
    int calls_ = 0;
};

}  // namespace xcalib

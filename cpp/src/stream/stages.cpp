#include "xcalib/stream/stages.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <limits>
#include <mutex>
#include <system_error>
#include <thread>

#include "xcalib/stream/interrupts.hpp"

namespace xcalib {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
}

// How often the caller looks whether it is asked to end.
constexpr auto kPatience = std::chrono::milliseconds(100);

class Run {
   public:
    Run(int count, const std::vector<Stage>& stages, int threads)
        : stages_(stages), threads_(threads), end_(count), turns_(stages.size()),
          busy_(stages.size()) {}

    void operator()(const std::function<void(int, const BusyShares&)>& progress) {
        std::vector<std::thread> threads;
        try {
            for (int slot = 0; slot < threads_; ++slot)
                threads.emplace_back([this, slot] { work(slot); });
        } catch (const std::system_error&) {  // the system gives no more
            if (threads.empty()) throw;
        }
        std::exception_ptr refusal;
        try {
            watch(progress);
        } catch (...) {
            refusal = std::current_exception();
            const std::lock_guard lock(mutex_);
            end_ = 0;
        }
        for (std::thread& thread : threads) thread.join();
        if (failure_) std::rethrow_exception(failure_);
        if (refusal) std::rethrow_exception(refusal);
    }

   private:
    void work(int slot) {
        std::unique_lock lock(mutex_);
        ++working_;
        while (next_ < end_ && !interrupted()) {
            const int frame = next_++;
            lock.unlock();
            const bool through = pass(frame, slot);
            lock.lock();
            if (through) ++done_;
            changed_.notify_all();
        }
        if (--working_ == 0) changed_.notify_all();
    }

    // False where this frame, or one before it, failed.
    bool pass(int frame, int slot) {
        for (std::size_t i = 0; i < stages_.size(); ++i) {
            if (!wait_for_turn(i, frame)) return false;
            const Clock::time_point start = Clock::now();
            std::exception_ptr error;
            try {
                stages_[i].run(frame, slot);
            } catch (...) {
                error = std::current_exception();
            }
            const double seconds = seconds_since(start);
            const std::lock_guard lock(mutex_);
            busy_[i] += seconds;
            if (error) {
                if (frame < failed_) {
                    failed_ = frame;
                    failure_ = error;
                }
                end_ = 0;
            }
            turns_[i] = frame + 1;
            changed_.notify_all();
            if (error) return false;
        }
        return true;
    }

    bool wait_for_turn(std::size_t stage, int frame) {
        std::unique_lock lock(mutex_);
        if (stages_[stage].in_order)
            changed_.wait(lock, [&] { return turns_[stage] == frame || failed_ < frame; });
        return failed_ > frame;
    }

    void watch(const std::function<void(int, const BusyShares&)>& progress) {
        const auto over = [this] { return (next_ >= end_ || interrupted()) && working_ == 0; };
        std::unique_lock lock(mutex_);
        for (bool last = false; !last;) {
            const int before = done_;
            changed_.wait_for(lock, kPatience, [&] { return done_ > before || over(); });
            last = over();
            const int done = done_;
            const BusyShares busy = shares();
            lock.unlock();
            progress(done, busy);
            lock.lock();
        }
    }

    BusyShares shares() const {
        const double elapsed = std::max(seconds_since(start_), 1e-9);
        BusyShares shares;
        for (std::size_t i = 0; i < stages_.size(); ++i) {
            const std::string& name = stages_[i].name;
            const double share =
                std::min(busy_[i] / elapsed / (stages_[i].in_order ? 1 : threads_), 1.0);
            const auto known = std::find_if(shares.begin(), shares.end(),
                                            [&](const auto& one) { return one.first == name; });
            if (known == shares.end()) shares.emplace_back(name, share);
            else known->second = std::max(known->second, share);
        }
        return shares;
    }

    const std::vector<Stage>& stages_;
    const int threads_;
    const Clock::time_point start_ = Clock::now();

    std::mutex mutex_;
    std::condition_variable changed_;
    int next_ = 0, end_;  // the next frame to be begun, before the end
    int done_ = 0, working_ = 0;
    std::vector<int> turns_;    // of each stage: the frame that may pass where they do so in order
    std::vector<double> busy_;  // [s] of each stage, summed over threads
    int failed_ = std::numeric_limits<int>::max();  // the first frame that did
    std::exception_ptr failure_;
};

}  // namespace

void run_stages(int count, const std::vector<Stage>& stages, int threads,
                const std::function<void(int done, const BusyShares& busy)>& progress) {
    Run(count, stages, threads)(progress);
}

}  // namespace xcalib

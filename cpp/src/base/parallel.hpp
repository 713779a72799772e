// Splits a range over threads. Each index is handled whole by one thread, so what is computed per
// index does not depend on how many there are.
#pragma once

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#include "base/workers.hpp"

namespace xcalib {

inline int resolve_threads(int num_threads) {
    if (num_threads > 0) return num_threads;
    return std::max(1u, std::thread::hardware_concurrency());
}

// Calls work(begin, end) on consecutive parts of [0, count). The exception of
// the lowest part is passed on, so that it does not depend on the timing.
template <class Work>
void parallel_ranges(int count, int num_threads, const Work& work) {
    const int parts = std::min(resolve_threads(num_threads), count);
    if (parts <= 1) {
        if (count > 0) work(0, count);
        return;
    }
    std::vector<std::exception_ptr> errors(parts);
    const auto guarded = [&](int part) {
        try {
            work(static_cast<int>(static_cast<long>(count) * part / parts),
                 static_cast<int>(static_cast<long>(count) * (part + 1) / parts));
        } catch (...) {
            errors[part] = std::current_exception();
        }
    };
    if (Workers* workers = WorkersOfThread::here()) workers->each(parts, guarded);
    else Workers(parts).each(parts, guarded);
    for (const std::exception_ptr& error : errors)
        if (error) std::rethrow_exception(error);
}

// Calls work(index) for each index of [0, count), whichever thread is free taking the next. The
// exception of the lowest index is passed on: all below it have been taken before.
template <class Work>
void parallel_each(int count, int num_threads, const Work& work) {
    std::atomic<int> next{0};
    std::mutex mutex;
    int failed = count;
    std::exception_ptr error;
    parallel_ranges(std::min(resolve_threads(num_threads), count), num_threads, [&](int, int) {
        for (int i = next++; i < count; i = next++) try {
                work(i);
            } catch (...) {
                next = count;
                const std::lock_guard<std::mutex> lock(mutex);
                if (i >= failed) continue;
                failed = i;
                error = std::current_exception();
            }
    });
    if (error) std::rethrow_exception(error);
}

}  // namespace xcalib

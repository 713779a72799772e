#include "workers.hpp"

namespace xcalib {

Workers::Workers(int num_threads) {
    for (int i = 1; i < num_threads; ++i) threads_.emplace_back([this] { wait_for_jobs(); });
}

Workers::~Workers() {
    {
        const std::lock_guard lock(mutex_);
        stop_ = true;
    }
    posted_.notify_all();
    for (std::thread& thread : threads_) thread.join();
}

void Workers::take_parts(const Job& job) {
    for (int part = next_++; part < job.count; part = next_++) job.call(job.work, part);
}

void Workers::run(const Job& job) {
    const std::unique_lock alone(busy_, std::try_to_lock);
    if (threads_.empty() || job.count <= 1 || !alone) {
        for (int part = 0; part < job.count; ++part) job.call(job.work, part);
        return;
    }
    {
        const std::lock_guard lock(mutex_);
        job_ = &job;
        next_ = 0;
        ++jobs_;
    }
    posted_.notify_all();
    take_parts(job);
    // A thread that has not come by now is not waited for.
    std::unique_lock lock(mutex_);
    job_ = nullptr;
    left_.wait(lock, [this] { return inside_ == 0; });
}

void Workers::wait_for_jobs() {
    unsigned long seen = 0;
    std::unique_lock lock(mutex_);
    while (true) {
        posted_.wait(lock, [&] { return stop_ || jobs_ != seen; });
        if (stop_) return;
        seen = jobs_;
        if (!job_) continue;
        const Job job = *job_;
        ++inside_;
        lock.unlock();
        take_parts(job);
        lock.lock();
        if (--inside_ == 0) left_.notify_one();
    }
}

}  // namespace xcalib

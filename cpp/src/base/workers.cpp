#include "base/workers.hpp"

#include <unistd.h>

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace xcalib {

struct Workers::Crew {
    std::atomic<bool> busy{false};  // by the one call that has the threads
    std::mutex mutex;
    std::condition_variable posted, left;
    const Job* job = nullptr;  // open to threads that come
    unsigned long jobs = 0;
    int inside = 0;  // threads that work on the job
    bool stop = false;
    std::atomic<int> next{0};
    std::vector<std::thread> threads;

    void take_parts(const Job& taken);
    void wait_for_jobs();
};

Workers::Workers(int num_threads) : process_(getpid()), crew_(std::make_unique<Crew>()) {
    crew_->threads.reserve(num_threads - 1);
    try {
        for (int i = 1; i < num_threads; ++i)
            crew_->threads.emplace_back([crew = crew_.get()] { crew->wait_for_jobs(); });
    } catch (const std::system_error&) {
        // There are no more to be had: the result does not depend on it.
    }
}

Workers::~Workers() {
    if (getpid() != process_) {
        // The threads stayed behind, and may have held the locks when they did: nothing of theirs
        // can be ended here, and to wait for it is to hang.
        static_cast<void>(crew_.release());
        return;
    }
    {
        const std::lock_guard lock(crew_->mutex);
        crew_->stop = true;
    }
    crew_->posted.notify_all();
    for (std::thread& thread : crew_->threads) thread.join();
}

void Workers::Crew::take_parts(const Job& taken) {
    for (int part = next++; part < taken.count; part = next++) taken.call(taken.work, part);
}

void Workers::run(const Job& job) {
    const auto alone = [&job] {
        for (int part = 0; part < job.count; ++part) job.call(job.work, part);
    };
    if (job.count <= 1 || getpid() != process_ || crew_->threads.empty()) return alone();
    if (crew_->busy.exchange(true, std::memory_order_acquire)) return alone();
    {
        const std::lock_guard lock(crew_->mutex);
        crew_->job = &job;
        crew_->next = 0;
        ++crew_->jobs;
    }
    crew_->posted.notify_all();
    crew_->take_parts(job);
    // A thread that has not come by now is not waited for.
    std::unique_lock lock(crew_->mutex);
    crew_->job = nullptr;
    crew_->left.wait(lock, [this] { return crew_->inside == 0; });
    crew_->busy.store(false, std::memory_order_release);
}

void Workers::Crew::wait_for_jobs() {
    unsigned long seen = 0;
    std::unique_lock lock(mutex);
    while (true) {
        posted.wait(lock, [&] { return stop || jobs != seen; });
        if (stop) return;
        seen = jobs;
        if (!job) continue;
        const Job taken = *job;
        ++inside;
        lock.unlock();
        take_parts(taken);
        lock.lock();
        if (--inside == 0) left.notify_one();
    }
}

}  // namespace xcalib

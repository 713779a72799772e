// Threads that wait between frames: starting one takes as long as a good part of a frame does.
#pragma once

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <vector>

namespace xcalib {

class Workers {
   public:
    // num_threads: with the caller's, at least 1.
    explicit Workers(int num_threads);
    ~Workers();
    Workers(const Workers&) = delete;
    Workers& operator=(const Workers&) = delete;

    // Calls work(part) for each part of [0, count), whichever thread is free taking the next, the
    // caller's among them. `work` must not throw. Where another call is under way, the caller's
    // thread does it all. Allocates nothing.
    template <class Work>
    void each(int count, const Work& work) {
        const Job job{[](const void* w, int part) { (*static_cast<const Work*>(w))(part); }, &work,
                      count};
        run(job);
    }

   private:
    struct Job {
        void (*call)(const void* work, int part);
        const void* work;
        int count;
    };

    void run(const Job& job);
    void take_parts(const Job& job);
    void wait_for_jobs();

    std::mutex busy_;  // held by the one call that has the threads
    std::mutex mutex_;
    std::condition_variable posted_, left_;
    const Job* job_ = nullptr;  // open to threads that come
    unsigned long jobs_ = 0;
    int inside_ = 0;  // threads that work on the job
    bool stop_ = false;
    std::atomic<int> next_{0};
    std::vector<std::thread> threads_;
};

}  // namespace xcalib

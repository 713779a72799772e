// Threads that wait between one piece of work and the next: starting one takes as long as a good
// part of a frame does.
#pragma once

#include <sys/types.h>

#include <memory>

#include "xcalib/export.hpp"

namespace XCALIB_EXPORT xcalib {  // the library of calibration, another, has them from here

class Workers {
   public:
    // num_threads: with the caller's, at least 1. Where the system gives fewer, it is these.
    explicit Workers(int num_threads);
    ~Workers();
    Workers(const Workers&) = delete;
    Workers& operator=(const Workers&) = delete;

    // Calls work(part) for each part of [0, count), whichever thread is free taking the next, the
    // caller's among them. `work` must not throw. Where another call is under way, and in a process
    // forked from that of the threads, the caller's thread does it all. Allocates nothing.
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
    struct Crew;  // the threads, and what they share

    void run(const Job& job);

    pid_t process_;  // that has the threads
    std::unique_ptr<Crew> crew_;
};

// As long as it lives, what its thread does in parallel (parallel.hpp) is shared out among these.
class WorkersOfThread {
   public:
    explicit WorkersOfThread(int num_threads) : workers_(num_threads), before_(here_) {
        here_ = &workers_;
    }
    ~WorkersOfThread() { here_ = before_; }
    WorkersOfThread(const WorkersOfThread&) = delete;
    WorkersOfThread& operator=(const WorkersOfThread&) = delete;

    static Workers* here() { return here_; }  // or null

   private:
    Workers workers_;
    Workers* before_;
    static inline thread_local Workers* here_ = nullptr;
};

}  // namespace xcalib

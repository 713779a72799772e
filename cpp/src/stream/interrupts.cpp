#include "xcalib/stream/interrupts.hpp"

#include <atomic>
#include <csignal>

namespace xcalib {
namespace {

constexpr int kSignals[] = {SIGINT, SIGTERM};

std::atomic<bool> came{false};
struct sigaction before[2];  // what the signals did, by their place in kSignals

void restore(int place) { sigaction(kSignals[place], &before[place], nullptr); }

void note(int signal) {
    if (!came.exchange(true)) return;
    restore(signal == kSignals[1]);
    std::raise(signal);
}

}  // namespace

Interrupts::Interrupts() {
    came = false;
    for (int place = 0; place < 2; ++place) {
        struct sigaction held {};
        held.sa_handler = note;
        held.sa_flags = SA_RESTART;
        sigaction(kSignals[place], nullptr, &before[place]);
        if (before[place].sa_handler != SIG_IGN) sigaction(kSignals[place], &held, nullptr);
    }
}

Interrupts::~Interrupts() {
    for (int place = 0; place < 2; ++place) restore(place);
    came = false;
}

bool interrupted() { return came; }

void check_interrupts() {
    if (interrupted()) throw Interrupted();
}

}  // namespace xcalib

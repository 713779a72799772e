// Requests to end, held back until work is whole.
#pragma once

#include <stdexcept>
#include <string>

#include "xcalib/export.hpp"

namespace XCALIB_EXPORT xcalib {

class Interrupted : public std::runtime_error {
   public:
    explicit Interrupted(const std::string& state = "interrupted") : std::runtime_error(state) {}
};

// As long as it lives, SIGINT and SIGTERM are only noted, unless they are ignored (as under nohup).
// A second one is not held back: it does what it did before. One at a time, in the main thread.
class Interrupts {
   public:
    Interrupts();
    ~Interrupts();
    Interrupts(const Interrupts&) = delete;
    Interrupts& operator=(const Interrupts&) = delete;
};

// Whether one has come since.
bool interrupted();
// Throws Interrupted then.
void check_interrupts();

}  // namespace xcalib

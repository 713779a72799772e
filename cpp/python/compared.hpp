// Two images that something compares.
#pragma once

#include "arrays.hpp"

namespace xcalib {

// Two images of one size as gray, and the mask over them. Throws ValueError where they do not fit.
struct Compared {
    Compared(const py::object& reference, const py::object& registered, const py::object& mask);

    Image reference, registered;
    HeldMask mask;
};

}  // namespace xcalib

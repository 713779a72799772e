// Two images that something compares.
#pragma once

#include <optional>

#include "arrays.hpp"

namespace xcalib {

// Two images of one size as gray, and the mask over them. Throws ValueError where they do not fit.
struct Compared {
    // mask: as `read` takes it, a registrar's or what is valid.
    Compared(const py::object& reference, const py::object& registered, const py::object& mask,
             decltype(&mask_of) read = mask_of);

    // The span of the gray values, whose integers are in [0, 1]: `data_range`, in the unit of the
    // images, or the range of their types. Throws ValueError where floats beyond [0, 1] have none.
    double range(const std::optional<double>& data_range) const;

    Image reference, registered;
    HeldMask mask;

   private:
    PixelType types_[2];
};

}  // namespace xcalib

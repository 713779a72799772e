// What the C interfaces of both libraries have in common.
#pragma once

#include "xcalib.h"
#include "xcalib/export.hpp"

namespace xcalib {

// Within a catch block: the status of what was thrown; keeps what it says for xcalib_last_error().
XCALIB_EXPORT xcalib_status status_of_exception() noexcept;

}  // namespace xcalib

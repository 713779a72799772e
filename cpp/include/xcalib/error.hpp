// What is thrown where input cannot be used.
#pragma once

#include <stdexcept>

#include "xcalib/export.hpp"

namespace XCALIB_EXPORT xcalib {

// A file, a folder or an argument that cannot be used; the message names it, and what was expected.
class InputError : public std::invalid_argument {
   public:
    using std::invalid_argument::invalid_argument;
};

// A file that cannot be decoded: truncated, or not what its name says.
class DecodeError : public InputError {
   public:
    using InputError::InputError;
};

}  // namespace xcalib

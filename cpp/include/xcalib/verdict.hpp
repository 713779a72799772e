// Is a calibration to be trusted, and how far off is it?
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "xcalib/export.hpp"

namespace XCALIB_EXPORT xcalib {

// How far the registered source is expected to lie from where it belongs, [px of the reference when
// its width is 640 px]: half of the pixels are no farther off than the median, and 95 % no farther
// than `p95`.
struct ExpectedError {
    double median = std::numeric_limits<double>::infinity();
    double p95 = std::numeric_limits<double>::infinity();
};

struct ErrorAtDepth {
    double depth = 0.0;  // [m], infinity for what is far
    ExpectedError error;
};

struct Verdict {
    bool trusted = false;
    bool found = false;            // two calibrations that share no frame agree
    std::string reason;            // why it is, or is not, to be trusted; one line
    std::string advice;            // what to do next; empty where it is trusted
    ExpectedError expected_error;  // over the depths that the footage has
    std::vector<ErrorAtDepth>
        by_depth;  // at 2 m and beyond, nearest first; none for relative depth

    int frames = 0;        // that it rests on
    std::string date;      // of the calibration, YYYY-MM-DD (UTC)
    std::string software;  // that made it, and its version

    std::string line() const;  // reason and advice

    // Between the depths of the table in proportion to inverse depth, in which parallax is linear;
    // nearer than all of them in that proportion too. NaN where there is no table, or for a depth
    // that is not positive.
    ExpectedError error_at(double depth) const;
};

}  // namespace xcalib

// What the numbers of depth maps mean.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "xcalib/export.hpp"
#include "xcalib/image.hpp"

namespace XCALIB_EXPORT xcalib {

struct DepthUnits {
    // Metres per unit of the numbers, of disparities px; none: 1/256 of the counts of a PNG, 1 of
    // floats.
    std::optional<double> scale = std::nullopt;
    // Numbers that mean unknown, besides those that are not above 0 or not finite, and the largest
    // count of 16 bits.
    std::vector<double> invalid = {};
    // The numbers are disparities d [px]: z = focal * baseline / (d + doffs). Baseline 0: they are
    // depth.
    double baseline = 0.0;  // [m]
    double focal = 0.0;     // [px]
    double doffs = 0.0;     // [px]

    bool is_disparity() const { return baseline != 0; }
    void validate() const;  // throws InputError: field, value, range
};

// Metres per unit of what --depth-unit says: m, cm, mm or 1/N. Throws InputError.
double depth_unit_of(const std::string& word);

// Metres of a map's numbers, uint16 or float32, one channel; 0 where unknown. `where` names the map
// in messages; `is_png`: counts without a scale are of 1/256. Throws InputError where the unit is
// not known, DecodeError where the depth of no pixel is.
Image metres_of(const ImageView& numbers, const DepthUnits& units, const std::string& where,
                bool is_png);

// A line on what a map was taken for: the range of its depth, its unit, the share that is unknown.
std::string units_line(const ImageView& numbers, const DepthUnits& units, const std::string& where,
                       bool is_png);

// What --depth may be, a line each, with when to use it; for the error where it is left out.
std::string depth_choices();

}  // namespace xcalib

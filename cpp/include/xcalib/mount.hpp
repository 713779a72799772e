// How the source camera is mounted: thermal modules are often turned on their side or upside down,
// or look into a mirror.
#pragma once

#include <optional>
#include <string>

#include "xcalib/camera.hpp"
#include "xcalib/export.hpp"

namespace XCALIB_EXPORT xcalib {

// How the source's image is turned against the reference's: clockwise by an angle, and then, if it
// is a mirror image, flipped left to right.
struct Mount {
    double roll_deg = 0.0;  // [deg]
    bool mirrored = false;

    // The nearest to how the rig's cameras stand, in (-180, 180].
    static Mount of(const Rig& rig);

    // "auto" (none), "upright", an angle as "90", "mirrored", or both as "mirrored-90". Throws
    // InputError, naming `option`, where it is none of these.
    static std::optional<Mount> parse(const std::string& option, const std::string& word);

    // What parse() takes for it.
    static std::string word(const std::optional<Mount>& mount);

    // "upright" up to 15 deg of roll, "upside down", "turned by 90 deg clockwise", "mirrored", ...
    std::string text() const;
};

}  // namespace xcalib

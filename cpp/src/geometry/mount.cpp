#include "xcalib/mount.hpp"

#include <cmath>
#include <cstdlib>

#include "base/format.hpp"
#include "xcalib/error.hpp"

namespace xcalib {
namespace {

constexpr double kDegrees = 180 / 3.14159265358979323846;
constexpr double kUpright = 15;  // of roll that nobody would call turned [deg]

}  // namespace

Mount Mount::of(const Rig& rig) {
    const Eigen::Matrix3d R = rig.R();
    return {std::atan2(R(1, 0) - R(0, 1), R(0, 0) + R(1, 1)) * kDegrees, rig.source_mirrored};
}

std::optional<Mount> Mount::parse(const std::string& option, const std::string& word) {
    if (word == "auto") return std::nullopt;
    if (word == "upright") return Mount{};
    const std::string mirror = "mirrored";
    Mount mount;
    mount.mirrored = word.compare(0, mirror.size(), mirror) == 0;
    std::string angle = mount.mirrored ? word.substr(mirror.size()) : word;
    if (mount.mirrored && angle.empty()) return mount;
    if (mount.mirrored) angle = angle[0] == '-' ? angle.substr(1) : "";
    char* end = nullptr;
    mount.roll_deg = std::strtod(angle.c_str(), &end);
    if (angle.empty() || *end || !(std::abs(mount.roll_deg) <= 360))
        throw InputError(option + " is '" + word +
                         "', expected auto, upright, degrees clockwise as 90, 180 or 270, "
                         "mirrored, or both as mirrored-90");
    return mount;
}

std::string Mount::word(const std::optional<Mount>& mount) {
    if (!mount) return "auto";
    const std::string angle = mount->roll_deg == 0 ? "" : format("%g", mount->roll_deg);
    if (!mount->mirrored) return angle.empty() ? "upright" : angle;
    return angle.empty() ? "mirrored" : "mirrored-" + angle;
}

std::string Mount::text() const {
    const double roll = std::remainder(roll_deg, 360.0);
    if (std::abs(roll) <= kUpright) return mirrored ? "mirrored" : "upright";
    const std::string turned = std::abs(roll) >= 180 - kUpright
                                   ? "upside down"
                                   : format("turned by %.0f deg %s", std::abs(roll),
                                            roll > 0 ? "clockwise" : "counterclockwise");
    return mirrored ? turned + ", then mirrored" : turned;
}

}  // namespace xcalib

#include "xcalib/depth/plane_depth.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/format.hpp"

namespace xcalib {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180;

}  // namespace

void PlaneDepth::validate() const {
    struct Range {
        const char* name;
        double value, low, high;
        const char* unit;
    };
    for (const Range& r :
         {Range{"camera_height", camera_height, 0, INFINITY, "m"},
          Range{"horizon", horizon, -1, 1, "of the image height"},
          Range{"far", far, 0, INFINITY, "m"}, Range{"hfov_deg", hfov_deg, 0, 180, "deg"},
          Range{"roll_deg", roll_deg, -45, 45, "deg"}}) {
        if (r.low < r.value && r.value < r.high) continue;  // NaN fails too
        const std::string between = std::isinf(r.high) ? format("above %g", r.low)
                                                       : format("between %g and %g", r.low, r.high);
        throw InputError(
            format("plane %s is %g, expected %s %s", r.name, r.value, between.c_str(), r.unit));
    }
}

Image PlaneDepth::operator()(int width, int height) const {
    const double fy = 0.5 * width / std::tan(hfov_deg * kDegree / 2);
    const double c = std::cos(roll_deg * kDegree), s = std::sin(roll_deg * kDegree);
    Image depth(width, height);
    for (int v = 0; v < height; ++v)
        for (int u = 0; u < width; ++u) {
            const double y = v - (horizon * height - 0.5), x = u - (width - 1) / 2.0;
            // A plane's inverse depth is linear in the image; the horizon is where it is zero.
            const double below = y * c - x * s;
            depth.row(v)[u] =
                static_cast<float>(below > 0 ? std::min(camera_height * fy / below, far) : far);
        }
    return depth;
}

}  // namespace xcalib

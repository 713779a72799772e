#include "xcalib/depth/depth_units.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <tuple>

#include "base/format.hpp"
#include "xcalib/error.hpp"

namespace xcalib {
namespace {

constexpr double kPngScale = 1.0 / 256;  // KITTI's
constexpr std::uint16_t kLargest = 65535;

double scale_of(const ImageView& numbers, const DepthUnits& units, const std::string& where,
                bool is_png) {
    if (units.scale) return *units.scale;
    if (numbers.type == PixelType::f32) return 1.0;
    if (is_png) return kPngScale;
    throw InputError(where + ": depth is uint16 counts, whose unit is not known; expected" +
                     " --depth-unit mm, m or 1/256, or floats in metres");
}

// Of the numbers as doubles.
template <class Number, class Use>
void each(const ImageView& numbers, const Use& use) {
    for (int y = 0; y < numbers.height; ++y) {
        const Number* row = numbers.row<Number>(y);
        for (int x = 0; x < numbers.width; ++x) use(x, y, row[x]);
    }
}

// Of those above 0, ascending.
float share_of(const std::vector<float>& sorted, double share) {
    return sorted[static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1))];
}

std::string unit_text(const ImageView& numbers, double scale, bool disparity) {
    const std::string unit = disparity ? "px" : "m";
    if (numbers.type == PixelType::f32 && scale == 1) return "floats in " + unit;
    const std::string number = scale == kPngScale ? "1/256" : format("%g", scale);
    return (numbers.type == PixelType::f32 ? "floats of " : "counts of ") + number + " " + unit;
}

}  // namespace

void DepthUnits::validate() const {
    if (scale && !(*scale > 0 && std::isfinite(*scale)))
        throw InputError(format("depth scale is %g, expected above 0 m per count", *scale));
    for (const double number : invalid)
        if (std::isnan(number)) throw InputError("invalid depth is nan, which is unknown anyway");
    if (!is_disparity()) return;
    for (const auto& [name, value, unit] :
         {std::tuple{"baseline", baseline, "m"}, {"focal", focal, "px"}})
        if (!(value > 0 && std::isfinite(value)))
            throw InputError(format("stereo %s is %g, expected above 0 %s", name, value, unit));
    if (!std::isfinite(doffs))
        throw InputError(format("stereo doffs is %g, expected a finite number [px]", doffs));
}

double depth_unit_of(const std::string& word) {
    if (word == "m") return 1;
    if (word == "cm") return 0.01;
    if (word == "mm") return 0.001;
    if (word.rfind("1/", 0) == 0) {
        double parts = 0;
        const char* const end = word.data() + word.size();
        if (std::from_chars(word.data() + 2, end, parts).ptr == end && parts > 0 &&
            std::isfinite(parts))
            return 1 / parts;
    }
    throw InputError("--depth-unit is '" + word +
                     "', expected mm, cm, m, or 1/256 (or another 1/N) of a metre");
}

Image metres_of(const ImageView& numbers, const DepthUnits& units, const std::string& where,
                bool is_png) {
    if (numbers.channels != 1)
        throw InputError(where + format(": depth has shape (%d, %d, %d), expected one channel (h,"
                                        " w)",
                                        numbers.height, numbers.width, numbers.channels));
    if (numbers.type == PixelType::u8)
        throw InputError(where + ": depth is uint8, expected a 16-bit PNG, or floats in metres");
    const auto scale = static_cast<float>(scale_of(numbers, units, where, is_png));
    const auto product = static_cast<float>(units.baseline * units.focal);
    const auto doffs = static_cast<float>(units.doffs);
    Image metres(numbers.width, numbers.height);
    const auto take = [&](int x, int y, float number, bool largest) {
        float& out = metres.row(y)[x];
        out = 0;
        if (largest || !std::isfinite(number)) return;
        if (std::find(units.invalid.begin(), units.invalid.end(), number) != units.invalid.end())
            return;
        float z = number * scale;
        // Nothing is beyond infinity, where the disparity is -doffs; 0 is unknown all the same.
        if (units.is_disparity()) z = number > 0 && z + doffs > 0 ? product / (z + doffs) : 0;
        if (z > 0 && std::isfinite(z)) out = z;
    };
    if (numbers.type == PixelType::u16)
        each<std::uint16_t>(numbers, [&](int x, int y, std::uint16_t number) {
            take(x, y, number, number == kLargest);
        });
    else each<float>(numbers, [&](int x, int y, float number) { take(x, y, number, false); });
    if (std::none_of(metres.pixels.begin(), metres.pixels.end(), [](float z) { return z > 0; }))
        throw DecodeError(where + ": all depth is unknown, expected some pixels above 0 m");
    return metres;
}

std::string units_line(const ImageView& numbers, const DepthUnits& units, const std::string& where,
                       bool is_png) {
    const Image metres = metres_of(numbers, units, where, is_png);
    std::vector<float> known;
    for (const float z : metres.pixels)
        if (z > 0) known.push_back(z);
    std::sort(known.begin(), known.end());
    const double count = static_cast<double>(metres.pixels.size());
    std::string line = "depth: ";
    line += format("%.3g to %.3g m", share_of(known, 0.05), share_of(known, 0.95));
    line += " by " +
            unit_text(numbers, scale_of(numbers, units, where, is_png), units.is_disparity()) +
            (units.is_disparity() ? " of disparity" : "");
    if (!units.scale && !units.is_disparity())
        line += numbers.type == PixelType::f32 ? " (--depth-unit mm, if they are not)"
                                               : " (--depth-unit mm reads millimetres)";
    const double unknown = 100 * (1 - static_cast<double>(known.size()) / count);
    if (unknown > 0) line += format("; %.1f %% is unknown", unknown);
    if (numbers.type == PixelType::u16) {
        std::size_t largest = 0;
        each<std::uint16_t>(numbers,
                            [&](int, int, std::uint16_t value) { largest += value == kLargest; });
        if (largest > 0)
            line += format(", of which 65535, the largest count, in %.1f %%",
                           100 * static_cast<double>(largest) / count);
    }
    return line + " (" + where + ")";
}

std::string depth_choices() {
    return "--depth FOLDER: a depth map for each reference image; measured depth is best\n"
           "--depth FOLDER --lidar-calibration FILE: lidar scans\n"
           "--depth stereo:FOLDER: images of a second, rectified visible camera\n"
           "--depth disparity:FOLDER: disparity maps, with --stereo-baseline and --stereo-focal\n"
           "--depth BAG#TOPIC: a depth camera's topic in a bag\n"
           "--depth MODEL.onnx: a monocular network, where nothing was measured (`xcalib models"
           " list`)\n"
           "--depth plane: a flat road, for cameras on vehicles\n"
           "--depth METRES: one distance for all: benches, facades, drones, far scenes";
}

}  // namespace xcalib

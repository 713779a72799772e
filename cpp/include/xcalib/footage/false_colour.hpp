// False-colour thermal images, turned back to one number per pixel.
//
// Each value was replaced by a colour of a map, and the gray of a colour is no function of the
// value (a rainbow is brightest in its middle). But the colours lie on one curve in the colour
// cube, and the place on that curve is the value. The curve is one of the known maps, or it is
// found in the colours themselves.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "xcalib/error.hpp"
#include "xcalib/export.hpp"
#include "xcalib/image.hpp"

namespace XCALIB_EXPORT xcalib {

// A curve in the colour cube, from cold to hot.
struct ColorMap {
    std::string name;
    std::array<std::array<std::uint8_t, 3>, 256> curve;  // blue, green, red

    // The place of each pixel on the curve, 0 to 255: width * height bytes. `image`: 3 channels.
    std::vector<std::uint8_t> invert(const ImageView& image) const;
};

// OpenCV's, and `iron`. Not `bone`: it is as gray as a dull photograph.
const std::vector<ColorMap>& known_color_maps();

// Throws InputError that lists the names.
const ColorMap& known_color_map(const std::string& name);

// The frames of `count` that a map is recognised by: a few, spread over the footage, rising.
std::vector<int> frames_to_recognise_by(int count);

// The map of false-colour images of one camera: the known one that is nearest, or one named
// `estimated`, whose bright end counts as hot. None for gray images, tinted ones, and photographs.
// A few images are enough, and more than one is better where the map is not a known one.
std::optional<ColorMap> recognise(const std::vector<ImageView>& images);

}  // namespace xcalib

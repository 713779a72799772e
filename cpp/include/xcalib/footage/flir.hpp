// What a radiometric JPEG of a FLIR camera has besides its picture: the raw thermal image, the
// visible one, and how counts become temperatures.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "xcalib/camera.hpp"
#include "xcalib/export.hpp"
#include "xcalib/image.hpp"

namespace XCALIB_EXPORT xcalib {

// Temperature of a count S: T = B / ln(R1 / (R2 (S + O)) + F) [K], of a black body.
struct Planck {
    double r1 = 0, b = 0, f = 0, o = 0, r2 = 0;
};

struct FlirParts {
    // The thermal counts, uint16, as an image file (PNG, TIFF), or plain, row by row.
    std::string thermal;
    int width = 0, height = 0;  // of them [px]
    bool is_file = false;
    bool big_endian = false;  // plain counts; and in a PNG, whose counts FLIR writes the wrong way
    std::string visible;      // an image file; empty where there is none
    int visible_width = 0, visible_height = 0;  // of it [px]
    std::optional<Planck> planck;
    // How the camera itself lays the images over each other: the ratio of the fields of view, and
    // how far the thermal one is off the visible one's middle [px of it].
    double real_to_ir = 0, offset_x = 0, offset_y = 0;
};

// None where the bytes are no such JPEG. Throws DecodeError, naming `name`, where it is damaged.
std::optional<FlirParts> flir_parts(std::string_view jpeg, const std::string& name);

// How the camera lays its images over each other, as a rig to start from: both look the same way
// from one place, and the offset is that of the thermal principal point. The reference has a
// horizontal field of view of 45 degrees, for the file does not say. Throws InputError, naming
// `name`, where the file does not say how either.
Rig flir_alignment(const FlirParts& parts, const std::string& name);

// Plain counts as an image's pixels, in this machine's order of bytes.
void put_counts_right(FlirParts& parts);

// Degrees Celsius of counts, float32; NaN where a count has none.
Image celsius_of(const ImageView& counts, const Planck& planck);

}  // namespace xcalib

// Rolling shutter: rows that are read one after another, so that what moves is sheared.
//
// A frame of the source is brought to the moment at which the reference's rows that look the same
// way were read, by what the motion to the next frame says of each pixel. All of it counts from
// when the first rows are read, and in shares of the time from frame to frame.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "xcalib/calibration_options.hpp"
#include "xcalib/camera.hpp"
#include "xcalib/export.hpp"
#include "xcalib/image.hpp"

namespace XCALIB_EXPORT xcalib {

// From the first row's reading to the last one's, of the time from frame to frame; 0: all at once.
struct Readout {
    double source = 0.0, reference = 0.0;

    bool any() const { return source != 0.0 || reference != 0.0; }
};

// A share from 0 to 1; nothing for `auto`. Throws InputError, naming the option.
std::optional<double> parse_readout(const std::string& option, const std::string& text);

// How much later a source pixel was read than the reference pixel that looks the same way, far
// away: at + per_column u + per_row v, in times from frame to frame.
struct RowDelay {
    double at = 0.0, per_column = 0.0, per_row = 0.0;

    double operator()(double u, double v) const { return at + per_column * u + per_row * v; }
};

// Where no rig is known, both cameras look the same way, upright, and as far up and down.
RowDelay row_delay(const Readout& readout, const std::optional<Rig>& rig, int width, int height);

// What an image shows at p stands at p + (x, y) in the next frame [px of the image that is
// straightened]; both of one size, which may be smaller than the image's.
struct Motion {
    Image x, y;
};

// Where pixels of an image go that was read with such a delay. `out` is of the image's size,
// channels and type. Cubic, or the nearest pixel as it is.
void straighten(const ImageView& image, const Motion& motion, const RowDelay& delay, bool nearest,
                const MutableImageView& out);

// The references' sources, straightened as if such a share were their readout beyond what is known
// of it; of a negative one, rows are moved the other way.
struct SourcesAtShare {
    double share = 0.0;
    std::vector<ImageView> sources;
};

struct ReadoutFit {
    double share = 0.0, error = 0.0;       // and its standard error
    std::vector<double> shares;            // that were tried
    std::vector<std::vector<double>> nec;  // of each frame at each of them
    bool seen = false;                     // Is it one, and not by chance?

    double taken() const;  // the share to give to the option: of two digits, at most 1
    std::string line(const std::string& camera) const;
};

// The share at which a refit of `rig` agrees best. `at`: rising, 0 in the middle among them, as far
// on either side. Throws std::invalid_argument.
ReadoutFit fit_readout(const std::vector<ImageView>& references,
                       const std::vector<ImageView>& depths, const std::vector<SourcesAtShare>& at,
                       const Rig& rig, const CalibrationOptions& options);

}  // namespace xcalib

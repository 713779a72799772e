// Which frames to calibrate on: those that determine the rig best together.
//
// A cheap look at a seeded sample of the footage keeps two small edge maps and the inverse depth of
// each candidate, never the images. Frames that cannot help are left out: undecodable, flat
// (a closed shutter), saturated, frozen, and pairs whose edges do not agree as the others' do (out
// of sync). The rest is taken one by one, each time the frame that adds most to `log det` of
// the information about the rig's eleven parameters, summed over the frames taken: a measure that
// grows with edges common to both images, with their spread over the image and their directions,
// and with the spread of depth, and that gives a second frame of the same kind less than the first.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "xcalib/edge_map.hpp"
#include "xcalib/export.hpp"
#include "xcalib/image.hpp"

namespace XCALIB_EXPORT xcalib {

// The frames of `count` that a choice of `max_frames` looks at: four for each wanted, one of each
// of as many equal parts of the footage, drawn with `seed`; rising.
std::vector<int> frames_to_look_at(int count, int max_frames, std::uint32_t seed);

// What is kept of one frame, and what became of it.
struct Candidate {
    int index = 0;            // of the frame in the footage
    bool decoded = true;      // false: there were no images to look at
    bool taken = false;       //
    std::string reason = "";  // why it was taken or left
    // Normalized correlation of the two images' edges where the footage as a whole aligns; NaN
    // where not measured.
    double agreement = std::numeric_limits<double>::quiet_NaN();
    // What it added, or at the end would have added, to the log-determinant; NaN as above.
    double gain = std::numeric_limits<double>::quiet_NaN();

    double edges[2] = {};  // root mean square gradient of reference and source, in their units
    EdgeMap fields[2];     // of reference and source, of unit norm
    Image inverse_depth;   // [1/m] on the reference field's grid, 0 unknown; empty: not asked for
    std::uint64_t pixels = 0;  // hash of the source
};

// `depth`: null leaves it out of the choice; else float32 [m], any size of the reference's aspect.
Candidate look_at(int index, const ImageView& reference, const ImageView& source,
                  const ImageView* depth);

struct Choice {
    std::vector<int> indices;           // of the frames taken, rising
    std::vector<Candidate> candidates;  // every frame looked at, in order

    // Candidates that something was found against: they never were in the choice.
    std::vector<Candidate> unusable() const;
    // One line per candidate: its name, what was measured, why it was taken or left.
    std::string table(const std::function<std::string(int)>& name) const;
};

// At most `max_frames` of the candidates; none where none is usable. The images of a camera must be
// of one size.
Choice choose(std::vector<Candidate> candidates, int max_frames);

}  // namespace xcalib

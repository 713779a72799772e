// The global search that starts a calibration: no initial guess is needed.
//
// Edge maps correlate as they are: the Fourier product of conj(z_R) and z_S gives every
// displacement at once. Both are first drawn on a Mercator map of viewing directions, where a
// rotation of the camera is, near the horizon, a translation whatever the field of view; focal
// lengths and roll are looped over, and the frames of the rig pooled.
#pragma once

#include <vector>

#include "xcalib/calibration_options.hpp"
#include "xcalib/camera.hpp"
#include "xcalib/edge_map.hpp"
#include "xcalib/export.hpp"

namespace XCALIB_EXPORT xcalib {

// A reference camera to try, and the source cameras to try with it. Source cameras of the same
// place in two hypotheses have the same focal length, relative to the reference's.
struct SearchHypothesis {
    Pinhole reference;
    std::vector<Pinhole> sources;
};

struct SearchSpace {
    // Source cameras and rolls that do badly with the first are not tried with the others.
    std::vector<SearchHypothesis> hypotheses;
    std::vector<double> rolls;                           // [rad]
    Eigen::Matrix3d base = Eigen::Matrix3d::Identity();  // rotation that the search is centred on
    double max_shift = 0.0;  // of the reference's width on the map; 0: any
    SearchOptions options;   // min_overlap, map_width and candidates
};

struct SearchCandidate {
    Rig rig;                   // zero translation
    double score = 0.0;        // correlation above the typical at this scale, times overlap
    double correlation = 0.0;  // pooled, of doubled angles, in [-1, 1]
    double overlap = 0.0;
};

// `references` and `sources`: one size each, as many of the one as of the other. Best first.
std::vector<SearchCandidate> global_search(const std::vector<EdgeMap>& references,
                                           const std::vector<EdgeMap>& sources,
                                           const SearchSpace& space, int num_threads);

}  // namespace xcalib

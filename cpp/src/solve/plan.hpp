// What a calibration does, decided once at its start.
#pragma once

#include "xcalib/calibration_options.hpp"
#include "xcalib/flow.hpp"

namespace xcalib {

// Parts of the method, for a study of what each is worth (bench/experiments): all belong on.
struct Parts {
    bool images = true;         // the image loss; off, the flow term and the prior move the rig
    bool pyramid = true;        // off: what the search has found and placed is solved at full size
    bool stages = true;         // off: everything is free, without a prior, from the first level on
    bool floor = true;          // of the objective's edges; off: they count however weak
    bool pair_weights = true;   // c_i; off: every pair counts alike
    bool normalization = true;  // photometric; off: gray values as given
    bool depth_edges = true;    // are left out of the NEC at the finer levels; off: not
};

struct Plan {
    // Throws std::invalid_argument where the options are not valid.
    explicit Plan(const CalibrationOptions& options, const FlowEstimator& estimator = nullptr,
                  const Parts& parts = {});

    CalibrationOptions options;
    Mount mount;              // that is tried
    FlowEstimator estimator;  // of the caller; none: the built-in patch flow
    Parts parts;

    bool searches;   // for the start; else it is given
    bool uses_flow;  // the flow term
    // All frames are solved from the coarsest level on, since flow reaches further the coarser the
    // level is; else from the level at which the start was found.
    bool from_coarsest;
    bool estimates_lens;  // is a lens of the source tried?
    // So many of k1 and k2 of the source move, in stage 2 at the finer levels; k1 in any case where
    // one that is estimated bends.
    int lens_coefficients = 0;
    // The reference's principal point, and both of its focal lengths together, move at the finer
    // levels where the source's lens bends: of pinholes they are a gauge, but a lens bends about
    // one point, and is as strong as it is at one focal length only.
    bool fits_gauge;
};

}  // namespace xcalib

// By how much one camera's clock is late: from the footage itself, and, where there is a rig, from
// how well its frames register.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "xcalib/camera.hpp"
#include "xcalib/error.hpp"
#include "xcalib/export.hpp"
#include "xcalib/image.hpp"

namespace XCALIB_EXPORT xcalib {

// -- From the footage -----------------------------------------------------------------------------
//
// When the rig moves, edges move in both images, and the amount of that rises and falls together.
// The change of the edges from frame to frame is taken in the cells of a coarse grid, so that
// different parts of the scene show, and correlated over time.

struct OffsetEstimate {
    double offset = 0.0;  // by how much the source's clock is late [s]; 0 where it cannot be known
    bool trusted = false;
    double correlation = 0.0;  // height of the peak, in [-1, 1]
    double contrast = 0.0;     // what it stands above the best peak elsewhere
    double peak = 0.0;         // where the peak is [s], trusted or not

    std::string line() const;
};

// Magnitude of the gradient of a small gray copy, about 1 on an edge whatever the gain; pixels that
// are not finite count as black.
Image motion_edges(const ImageView& image);

// motion_edges() of a frame; none where it cannot be decoded.
using EdgesOfFrame = std::function<std::optional<Image>(int index)>;

// A constant offset between the clocks of two streams, neither registered. `references`, `sources`:
// times of their frames [s], never falling, each on its own clock. `max_offset`: the largest
// looked for, either way [s]; also at most a third of the footage. `max_frames`: references asked
// for at most, from the middle of the footage. Throws InputError where the times do not overlap.
OffsetEstimate estimate_offset(const std::vector<double>& references,
                               const std::vector<double>& sources,
                               const EdgesOfFrame& reference_edges,
                               const EdgesOfFrame& source_edges, double max_offset = 2.0,
                               int max_frames = 1500);

// -- From registration ----------------------------------------------------------------------------

struct RefinedOffset {
    // By how much the source's clock is late [s]; the middle candidate where it cannot be known.
    double offset = 0.0;
    bool decided = false;        // whether the frames register worse at both ends of the candidates
    std::vector<double> scores;  // mean NEC at each candidate; none if fewer than two can be judged

    std::string line() const;
};

// Candidates: 6 frames of the faster stream either way, in quarters [s].
std::vector<double> offsets_around(double guess, const std::vector<double>& references,
                                   const std::vector<double>& sources);

// NEC of a reference and a source frame, registered; 0 where no pixel is valid.
class RegisteredNec {
   public:
    // Rescaled to the frames.
    explicit RegisteredNec(const Rig& rig);
    ~RegisteredNec();

    // Frames of one size. `depth`: float32 [m], 0 unknown.
    double operator()(const ImageView& reference, const ImageView& source, const ImageView& depth);

   private:
    struct State;
    std::unique_ptr<State> state_;
};

// RegisteredNec of two frames; none where one of them cannot be decoded.
using PairScore = std::function<std::optional<double>(int reference, int source)>;

// Chooses among `candidates` [s], rising, around a guess in their middle. Among those that differ
// from the best by less than the frames do among each other (two standard errors of the mean), the
// one nearest to the middle is taken: the guess, unless the frames speak against it. Candidates
// that pair the same frames score the same. `max_frames`: of the slower stream, spread over the
// footage, the same ones for every candidate. Throws InputError without candidates.
RefinedOffset refine_offset(const std::vector<double>& references,
                            const std::vector<double>& sources,
                            const std::vector<double>& candidates, const PairScore& score,
                            int max_frames = 12);

}  // namespace xcalib

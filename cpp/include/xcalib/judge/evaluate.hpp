// How well a rig registers real frames, beside the source that is only resized.
//
// Every pair is judged as gray in [0, 1] on a reference grid of about 600 px width, the registered
// and the unregistered source over the *same* pixels: those the registration can fill, eroded by
// 2 px, because the rim of a warp is not an edge.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "xcalib/camera.hpp"
#include "xcalib/export.hpp"
#include "xcalib/image.hpp"
#include "xcalib/verdict.hpp"

namespace XCALIB_EXPORT xcalib {

// The metrics of metrics.hpp, by the names that they have everywhere.
inline constexpr std::array<const char*, 8> kScoreNames = {
    "nec", "gc", "ssim", "ncc", "rmse", "psnr", "patch_median", "patch_under_2px"};

// Agreement of one image, or the mean of many, with the reference, in the order of kScoreNames;
// NaN where undefined. psnr in dB, patch_median in px, patch_under_2px a share of the patches.
using Scores = std::array<double, kScoreNames.size()>;

struct Evaluation {
    int width = 0, height = 0;  // that the images are judged at [px]
    double valid_share = 0.0;   // mean share of the pixels judged
    Scores registered, unregistered;
    std::vector<std::pair<Scores, Scores>> frames;  // registered and unregistered
    // Of images that another method registered, over the same pixels, where they were given.
    std::optional<Scores> given;
    std::vector<Scores> given_frames;
    // Of the rig on a dozen of these frames, as a calibration would have it; none where it was not
    // asked for, or where no two frames can be judged.
    std::optional<Verdict> verdict;

    // Change of a score by registration [%], NaN where undefined.
    double gain(std::size_t score) const;
    std::string table() const;  // one line a score
    // What the verdict on these frames is, and whether it differs from that of the rig's file: a
    // line each, empty where there is nothing to say.
    std::string verdict_line() const;
    std::string difference(const Rig& rig, const std::string& rig_file) const;
};

class Evaluator {
   public:
    // `width`: the reference is reduced by the smallest integer that makes it at most this wide.
    Evaluator(const Rig& rig, int width = 640, int num_threads = 0);
    ~Evaluator();

    // Frames of one size, of the aspects of the rig's. depth: float32 [m], 0 unknown.
    // given: the source as another method registers it, of any size of the reference's aspect; of
    // every frame or of none.
    void add(const ImageView& reference, const ImageView& source, const ImageView& depth,
             const ImageView* given = nullptr);

    // Throws std::invalid_argument without a frame. `judge`: with a verdict, which takes seconds.
    Evaluation result(bool judge = false) const;

   private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace xcalib

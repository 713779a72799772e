// Two calibrations that share no frame: what they agree on, chance has not made.
#pragma once

#include <array>
#include <functional>
#include <optional>

#include "calibrate/start.hpp"
#include "solve/working_images.hpp"

namespace xcalib {

struct Halves {
    std::array<std::optional<Rig>, 2> rigs;  // none where the search found nothing
    std::optional<Start> start;              // of the better half; none with one pair
    bool independent = false;  // each was found from its own frames, not from a rig of all
};

// The frames of the two halves, in blocks: neighbours look alike, and stand in one half.
std::array<std::vector<std::size_t>, 2> halves_of(std::size_t count);

// Each half searched, placed and refined by itself, up to half resolution. `reference` and `source`
// give the sizes of the cameras.
Halves fit_halves(const WorkingImages& images, const ImageView& reference, const ImageView& source,
                  const std::optional<Rig>& initial, const Plan& plan,
                  const std::function<void(double)>& progress);

// Both halves from a rig of all frames, where nothing was searched: what they show is precision.
Halves refit_halves(const WorkingImages& images, const Rig& rig, const Plan& plan,
                    double valid_share);

// Of two halves that differ by less than this share of the width, chance has not made one: fits
// that are wrong lie 2.5 % and more apart, most of them by far.
inline constexpr double kFarthest = 0.016;
bool agree(const Halves& halves, const WorkingImages& images);

// How well edges agree at a rig, at half resolution, on frames from all of the footage.
double merit_on(const WorkingImages& images, const Rig& rig, const Plan& plan);

// Median distance between the halves over the footage [working px]; infinite where one has no rig.
double distance(const Halves& halves, const WorkingImages& images);

}  // namespace xcalib

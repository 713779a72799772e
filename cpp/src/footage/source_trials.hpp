// Refits of a rig with other sources in place of the references' own, and the NEC of each frame.
#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "solve/plan.hpp"
#include "solve/working_images.hpp"
#include "xcalib/calibrate.hpp"

namespace xcalib {

// What is fitted with one list of sources.
struct Trial {
    std::vector<std::size_t> frames;  // of the references, that have a source
    std::shared_ptr<const WorkingImages> images;
    Rig rig;
    std::vector<double> nec;  // of each reference; NaN where there is no source
    int factor = 0;           // of the level that these belong to
};

// The mean of what one trial has above another, over the references that both have.
struct Difference {
    double mean = 0.0, error = INFINITY;
    int frames = 0;
    // Whether it is above 0, and not by chance.
    bool decides(double deviations, double least) const {
        return mean > std::max(deviations * error, least);
    }
};
Difference difference(const std::vector<double>& a, const std::vector<double>& b,
                      std::size_t begin = 0, std::size_t end = SIZE_MAX);

class SourceTrials {
   public:
    // `rig`: fitted to the references with `own`, one source for each. Frames are validated.
    SourceTrials(const std::vector<ImageView>& references, const std::vector<ImageView>& own,
                 const std::vector<ImageView>& depths, const Rig& rig,
                 const CalibrationOptions& options);

    // As it is seen here, where sources are not mirrored; `given` turns it back.
    const Rig& rig() const { return rig_; }
    Rig given(const Rig& rig) const;

    // With the references' own sources.
    Trial start() const;
    // With one source for each reference, an empty view where there is none.
    Trial start(const std::vector<ImageView>& sources) const;

    // Refits at a level, from the better of the rigs `starts`, and takes the NEC of every frame.
    void refit(int factor, const std::vector<Rig>& starts, Trial& trial) const;

   private:
    Trial with(WorkingImages images, std::vector<std::size_t> frames) const;

    Plan plan_;
    bool mirrored_;
    Rig rig_;
    WorkingImages images_;
};

}  // namespace xcalib

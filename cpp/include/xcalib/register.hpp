// Registrar: one rig, a stream of frames. No solver, no search, no Ceres.
#pragma once

#include <cstdint>
#include <vector>

#include "xcalib/camera.hpp"
#include "xcalib/image.hpp"
#include "xcalib/warp.hpp"

namespace xcalib {

class Registrar {
   public:
    // num_threads: 0 uses every core. nearest: take the pixel next to the point as it is, instead
    // of interpolating between four. Throws std::invalid_argument where the rig is not valid.
    explicit Registrar(const Rig& rig, int num_threads = 0, bool nearest = false);

    const Rig& rig() const { return rig_; }

    // Source coordinates of each reference pixel, (height x width x 2) floats [px], x then y; NaN
    // where there is none. `depth`: one float32 channel [m], any size of the reference's aspect.
    void map(const ImageView& depth, float* out) const;

    // Samples `source` on the reference grid. `registered` has the source's type and channels and
    // the reference's size; `mask` takes width * height Validity codes. Pixels that are not valid
    // are 0. Throws std::invalid_argument where a size or type does not fit.
    void register_frame(const ImageView& source, const ImageView& depth,
                        const MutableImageView& registered, std::uint8_t* mask) const;

   private:
    // The depth on the reference's grid: as given where it has that size, else resized into `room`.
    ImageView on_reference_grid(const ImageView& depth, Image& room) const;

    Rig rig_;
    Reprojection reprojection_;
    int num_threads_;
    bool nearest_;
};

}  // namespace xcalib

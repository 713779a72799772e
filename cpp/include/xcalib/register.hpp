// Registrar: one rig, a stream of frames. No solver, no search, no Ceres.
#pragma once

#include <cstdint>
#include <memory>

#include "xcalib/camera.hpp"
#include "xcalib/export.hpp"
#include "xcalib/image.hpp"
#include "xcalib/warp.hpp"

namespace XCALIB_EXPORT xcalib {

// Reference pixels that the source camera sees something nearer in front of.
enum class Occlusion {
    ignore,  // are not looked for
    mark,    // the mask marks them; the image shows what is in front: holes would be edges
    hide,    // are 0 in the image too, and NaN in the map: nothing is seen twice
};

struct RegistrarOptions {
    int num_threads = 0;   // 0 uses every core
    bool nearest = false;  // take the pixel next to the point as it is, not a mean of four
    Occlusion occlusion = Occlusion::mark;
    // Metres per unit of uint16 depth; 1.0 / 256 is KITTI's. 0: refuse integers, which carry no
    // unit of their own.
    double depth_scale = 0;

    // Throws std::invalid_argument naming the field, its value and the allowed range.
    void validate() const;
};

class Registrar {
   public:
    // Throws std::invalid_argument where the rig or an option is not valid.
    explicit Registrar(const Rig& rig, const RegistrarOptions& options = {});
    ~Registrar();
    Registrar(Registrar&&) noexcept;
    Registrar& operator=(Registrar&&) noexcept;

    const Rig& rig() const;
    const RegistrarOptions& options() const;

    // Source coordinates of each reference pixel, (height x width x 2) floats [px], x then y; NaN
    // where there is none. `depth`: one channel, float32 [m] or uint16 (see depth_scale), 0
    // unknown, any size of the reference's aspect.
    void map(const ImageView& depth, float* out) const;

    // Samples `source` on the reference grid. `registered` has the source's type and channels and
    // the reference's size; `mask` takes width * height Validity codes. Pixels that are not valid
    // are 0, but for those that are only marked as occluded. Nothing is
    // allocated but for the first depth of another size than those before. Several threads may call
    // it at once, each beyond the first with buffers of its own; in a forked process, the caller's
    // works alone. Throws std::invalid_argument where a size or type does not fit.
    void register_frame(const ImageView& source, const ImageView& depth,
                        const MutableImageView& registered, std::uint8_t* mask) const;

   private:
    struct Stream;  // the rig, and what is kept between frames: threads and buffers

    std::unique_ptr<Stream> stream_;
};

}  // namespace xcalib

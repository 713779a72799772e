// The viewing rays of a camera whose lens bends, a table: to undo a lens takes Newton's method for
// each pixel, and the reference camera stays the same from frame to frame.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "xcalib/camera.hpp"

namespace xcalib {

struct Rays {
    static constexpr int kRoom = 64;  // past the end of a row, so that vectors are read whole

    int width, height;
    std::vector<float> x, y;  // X/Z and Y/Z; NaN where the lens shows nothing

    explicit Rays(const Pinhole& camera);
    std::size_t stride() const { return static_cast<std::size_t>(width) + kRoom; }
    const float* row_x(int row) const { return x.data() + row * stride(); }
    const float* row_y(int row) const { return y.data() + row * stride(); }
};

// Those of a camera with a lens, shared: the tables of the cameras that were asked for last are
// kept, for a calibration asks for the same few a thousand times.
std::shared_ptr<const Rays> rays_of(const Pinhole& camera);

}  // namespace xcalib

// Single points from either image of a frame to the other, through the depth of the reference:
// labels, key points, where something was clicked. Images are the registrar's.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "xcalib/camera.hpp"
#include "xcalib/export.hpp"
#include "xcalib/image.hpp"

namespace XCALIB_EXPORT xcalib {

// What became of a point: the codes of a mask, and one more.
enum class Transferred : std::uint8_t {
    valid = 0,
    outside = 1,    // of the other image, or nothing there that the reference shows
    occluded = 2,   // the source camera sees something nearer there; the point is given
    no_depth = 3,   // of the reference, at the point
    ambiguous = 4,  // between a near and a far surface: it belongs to neither
};

struct TransferredPoint {
    // [px]; NaN where the code is no_depth or ambiguous, or the other camera cannot see there.
    // Points outside lie where they would if the image were larger.
    Eigen::Vector2d point = Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
    double depth = std::numeric_limits<double>::quiet_NaN();  // in the reference camera [m]
    Transferred code = Transferred::valid;
};

// A reference pixel at a depth [m] in the source: valid, outside or no_depth.
TransferredPoint transfer(const Rig& rig, const Eigen::Vector2d& pixel, double depth);

// A source pixel in the reference, of something at this depth in the reference camera [m].
TransferredPoint transfer_back(const Rig& rig, const Eigen::Vector2d& pixel, double depth);

// A frame: the surface that its depth map shows, seen by both cameras.
class FrameTransfer {
   public:
    // depth: float32 [m], 0 unknown, of any size of the reference's aspect. Throws
    // std::invalid_argument where rig or depth is not valid.
    FrameTransfer(const Rig& rig, const ImageView& depth);
    ~FrameTransfer();
    FrameTransfer(FrameTransfer&&) noexcept;
    FrameTransfer& operator=(FrameTransfer&&) noexcept;

    // Depth at a reference pixel: interpolated where its neighbours lie on one surface, else that
    // of the nearest; 0 where that is not known.
    double depth_at(const Eigen::Vector2d& pixel) const;

    TransferredPoint to_source(const Eigen::Vector2d& pixel) const;
    // Of what is in front where the source sees several surfaces.
    TransferredPoint to_reference(const Eigen::Vector2d& pixel) const;

    // Reference coordinates of each source pixel, x then y: (height x width x 2) of the source; NaN
    // where to_reference() is not valid. The inverse of Registrar::map.
    std::vector<float> inverse_map() const;

   private:
    struct Surface;
    std::unique_ptr<Surface> surface_;
};

}  // namespace xcalib

// Where reference pixels lie in the source, Eq. (3d_mapping): the one place that knows. Kernels
// take a row of it in vectors (projector-inl.hpp); `transfer` is the same for one point, in double.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "geometry/rays.hpp"
#include "xcalib/camera.hpp"
#include "xcalib/export.hpp"
#include "xcalib/warp.hpp"

namespace XCALIB_EXPORT xcalib {  // the library of calibration, another, has it from here

// A point nearer to the source camera's plane than this has no stable projection. [m]
inline constexpr double kNearestZ = 1e-3;

// So far beyond the outermost pixel centres a point still counts as on them: a pixel on the rim
// stays there whatever the last bit of a rounding says. [px]
inline constexpr float kRim = 1e-3f;

// D m x~ + c of a reference pixel x~ = (x, y, 1) and its depth D: along a row affine in x. Where
// the reference has a lens, x~ is its ray (X/Z, Y/Z, 1) instead.
struct PixelTransform {
    Eigen::Matrix3d m;
    Eigen::Vector3d c;
};

struct Projector {
    // Homogeneous source pixels, before the source's lens bends: K_S R K_R^-1 and K_S t.
    PixelTransform to_image;
    PixelTransform to_camera;  // points of the source camera [m]: R K_R^-1 and t
    // K_R^-1: (X/Z, Y/Z, 1) in the reference camera, or where its lens shows that.
    Eigen::Matrix3d to_ray;
    int source_width, source_height;
    Eigen::Matrix3d source_K;  // of the image as it is, mirrored or not
    Lens source_lens;          // in the axes of the source camera
    Lens reference_lens;
    std::shared_ptr<const Rays> rays;  // null: the reference is a pinhole

    explicit Projector(const Rig& rig);

    // Does either lens bend?
    bool bends() const { return rays || source_lens.bends(); }

    // How far apart in the source the points of pixel (x, y) and of the next one in its row are, of
    // something far; 0 where it has none. [px]
    double step_along_row(int x, int y) const;

    // Of the pixels of row y, those of a greater depth lie in front of the source camera. The
    // reference is a pinhole. [m]
    float least_depth(int y, int width) const;
};

// Where the source sees the reference pixel (x, y) of this depth, be it within its image or not;
// NaN where nowhere: without a depth, behind the camera, and where a lens shows nothing. [px]
Eigen::Vector2d transfer(const Rig& rig, double x, double y, double depth);

// One row: source coordinates [px] of the reference pixels (0..width-1, y), and their Validity.
// Coordinates of pixels that are not valid are NaN.
void map_row(const Projector& projector, const float* depth, int y, int width, float* u, float* v,
             std::uint8_t* validity);

// d (x', y') / d (x, y) of a lens: symmetric.
struct LensSlope {
    float xx = 1, xy = 0, yy = 1;
};

// A reference pixel at its depth as both cameras see it: what the derivative of the mapping by any
// parameter is put together from.
struct SeenPoint {
    float ray_x, ray_y;  // K_R^-1 x~: X_R / Z_R, Y_R / Z_R, or where the reference's lens shows it
    float rx, ry, rz;    // R X_R [m]
    float x, y, inverse_z;     // X_S / Z_S, Y_S / Z_S, 1 / Z_S
    float shown_x, shown_y;    // where the source's lens shows (x, y); K_S takes it to pixels
    LensSlope source = {};     // d (shown_x, shown_y) / d (x, y)
    LensSlope reference = {};  // d (X_R / Z_R, Y_R / Z_R) / d (ray_x, ray_y)
};
SeenPoint seen_point(const Rig& rig, double x, double y, double depth);

// The same of a row of pixels; anything for those without a depth or behind the source camera.
// There is room for some more than `size` of them: vectors are written whole.
struct SeenRow {
    static constexpr int kRoom = 64;
    std::vector<float> ray_x, ray_y, rx, ry, rz, x, y, inverse_z;
    // Where neither lens bends these are empty: (x, y) is shown where it is.
    struct Slopes {
        std::vector<float> xx, xy, yy;
    };
    std::vector<float> shown_x, shown_y;
    Slopes source, reference;

    explicit SeenRow(int size) {
        for (auto* part : {&ray_x, &ray_y, &rx, &ry, &rz, &x, &y, &inverse_z})
            part->resize(size + kRoom);
    }
    bool bends() const { return !shown_x.empty(); }
};
void seen_row(const Projector& projector, const float* depth, int y, int width, SeenRow& out);

}  // namespace xcalib

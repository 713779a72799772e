// Cameras and rigs: the parameters that a calibration estimates.
//
// Conventions: pixel centres at integer coordinates, x right, y down, camera z forward; lengths in
// metres, angles in radians unless a name says otherwise. A transform `b_from_a` takes points of
// frame a to frame b.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <memory>
#include <optional>

#include "xcalib/export.hpp"
#include "xcalib/lens.hpp"
#include "xcalib/verdict.hpp"

namespace XCALIB_EXPORT xcalib {

// A pinhole camera, Eq. (intrinsic): u = fx x + skew y + cx, v = fy y + cy, with (x, y) =
// (X/Z, Y/Z), or where its lens shows that.
struct Pinhole {
    int width = 0;      // [px]
    int height = 0;     // [px]
    double fx = 0.0;    // [px], > 0
    double fy = 0.0;    // [px], > 0
    double cx = 0.0;    // [px]
    double cy = 0.0;    // [px]
    double skew = 0.0;  // [px]
    Lens lens = {};

    // Square pixels, principal point at the image centre; hfov() is this, but for p1 and p2 of the
    // lens. hfov in (0, pi), and what the lens shows.
    static Pinhole from_hfov(int width, int height, double hfov, const Lens& lens = {});
    // The inverse of K(); K may have any scale.
    static Pinhole from_K(int width, int height, const Eigen::Matrix3d& K);

    Eigen::Matrix3d K() const;
    // Between the ends of a row and of a column through the optical axis, were that at the image's
    // centre; without a lens 2 atan(width / (2 fx)). [rad]
    double hfov() const;
    double vfov() const;

    // What the image covers of the plane z = 1: the tangents of the angles to its borders. With a
    // lens, to the outermost of their points.
    struct Field {
        double left, right, top, bottom;
        double width() const { return right - left; }
    };
    Field field() const;
    // That of an image centred on the optical axis, without a lens: width / fx.
    double width_by_focal() const { return width / fx; }
    // Beside the optical axis, where no lens bends, along x and y.
    Eigen::Vector2d pixels_per_radian() const { return {fx, fy}; }

    // The same image of a view so many times as narrow, without a lens; the lens stays.
    Pinhole zoomed(double factor) const;

    // The same camera seen through its image flipped left to right.
    Pinhole flipped() const;
    // The same camera seen through an image of another size: x -> f x + (f - 1) / 2.
    Pinhole resized(int new_width, int new_height) const;

    // Throws std::invalid_argument naming `name`, the field, its value and what was expected.
    void validate(const char* name) const;
};

struct Pose {
    // Unit. Unaligned, so that a user's flags do not change what these structures look like.
    Eigen::Quaternion<double, Eigen::DontAlign> rotation = decltype(rotation)::Identity();
    Eigen::Vector3d translation = Eigen::Vector3d::Zero();  // [m]
};

// Relative inverse depth r, as many networks give it, in metres: D = 1 / (scale r + shift).
struct RelativeDepth {
    double scale = 1.0;  // > 0; the unit of the translation goes with it
    double shift = 0.0;

    // Throws std::invalid_argument naming `name`, the field, its value and what was expected.
    void validate(const char* name) const;
};

// Two cameras fixed to each other. The reference gives the pixel grid, the source is warped to it.
struct Rig {
    Pinhole reference;
    Pinhole source;
    Pose source_from_reference;
    std::optional<RelativeDepth> relative_depth = std::nullopt;  // none: metric depth
    // The source's image is a mirror image: its columns count against the camera's x axis,
    // u = cx - fx X/Z + skew Y/Z. Its lens, like all of `source`, is that of the image as it is.
    bool source_mirrored = false;
    // Of the calibration that estimated it; none: unknown.
    std::shared_ptr<const Verdict> verdict = nullptr;

    Eigen::Matrix3d R() const { return source_from_reference.rotation.toRotationMatrix(); }
    const Eigen::Vector3d& t() const { return source_from_reference.translation; }
    // Source pixels of (X/Z, Y/Z, 1) in the source camera, mirrored if its image is.
    Eigen::Matrix3d source_K() const;
    // The source's lens in its camera's axes, flipped if the image is mirrored: what comes before
    // source_K().
    Lens source_lens() const { return source_mirrored ? source.lens.flipped() : source.lens; }

    // Source pixels to a reference pixel, of something far on the optical axes, along x and y.
    Eigen::Vector2d source_density() const {
        return source.pixels_per_radian().cwiseQuotient(reference.pixels_per_radian());
    }

    Rig resized(int reference_width, int reference_height, int source_width,
                int source_height) const;
    void validate() const;
};

// The same rig for sources that have been flipped left to right.
Rig with_flipped_source(const Rig& rig);

// The rig for images of these sizes [px]: itself, or rescaled where both have the rig's aspects, to
// within a pixel. Throws InputError where one has not.
Rig fitted(const Rig& rig, int reference_width, int reference_height, int source_width,
           int source_height);

// Eq. (unprojection): the point at depth `z` behind pixel (u, v). NaN where the lens has none.
Eigen::Vector3d unproject(const Pinhole& camera, double u, double v, double z);

// Eq. (perspective_projection). `x_in_camera` must lie in front of the camera (z > 0). NaN where
// the lens shows no such point.
Eigen::Vector2d project(const Pinhole& camera, const Eigen::Vector3d& x_in_camera);

// Eq. (infinite_homography): K_S R K_R^-1, where pixels at infinite depth go. Of the pinholes
// alone: with a lens no homography says it, `transfer` does.
Eigen::Matrix3d infinite_homography(const Rig& rig);

// The source camera turned where it stands, by exp(rotation) about its own axes [rad].
Rig turn_source(const Rig& rig, const Eigen::Vector3d& rotation);

// The unit quaternion of a rotation matrix. Throws std::invalid_argument where `R` is not one: R
// R^T = I and det R = 1, within 1e-6.
Eigen::Quaterniond rotation_of(const Eigen::Matrix3d& R);

}  // namespace xcalib

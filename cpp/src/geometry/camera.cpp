#include "xcalib/camera.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <sstream>
#include <stdexcept>

#include "base/format.hpp"
#include "xcalib/error.hpp"

namespace xcalib {
namespace {

constexpr double kPi = 3.14159265358979323846;

void require(bool ok, const char* camera, const char* field, double value, const char* expected) {
    if (ok) return;
    std::ostringstream message;
    message << camera << ": " << field << " = " << value << ", expected " << expected;
    throw std::invalid_argument(message.str());
}

// The point that the lens shows there, or, where it shows none, one as far out as there is any.
Eigen::Vector2d seen_through(const Lens& lens, const Eigen::Vector2d& shown) {
    constexpr double kFar = 1e3;
    if (const auto point = lens.undistort(shown)) return *point;
    return shown.normalized() * std::min(kFar, lens.max_radius());
}

double angle_of(const Lens& lens, const Eigen::Vector2d& shown) {
    return std::atan(seen_through(lens, shown).norm());
}

}  // namespace

Pinhole Pinhole::from_hfov(int width, int height, double hfov, const Lens& lens) {
    require(hfov > 0 && hfov < kPi, "camera", "hfov", hfov, "an angle in (0, pi) rad");
    Pinhole camera;
    camera.width = width;
    camera.height = height;
    const auto border = lens.distort({std::tan(hfov / 2), 0});
    require(border.has_value(), "camera", "hfov", hfov, "an angle in rad that its lens shows");
    camera.fx = camera.fy = width / (2 * border->norm());
    camera.lens = lens;
    camera.cx = (width - 1) / 2.0;
    camera.cy = (height - 1) / 2.0;
    return camera;
}

Pinhole Pinhole::from_K(int width, int height, const Eigen::Matrix3d& K) {
    const Eigen::Matrix3d k = K / K(2, 2);
    return {width, height, k(0, 0), k(1, 1), k(0, 2), k(1, 2), k(0, 1), {}};
}

Eigen::Matrix3d Pinhole::K() const {
    Eigen::Matrix3d k;
    k << fx, skew, cx, 0, fy, cy, 0, 0, 1;
    return k;
}

double Pinhole::hfov() const {
    const double half = width / (2 * fx);
    if (!lens.bends()) return 2 * std::atan(half);
    return angle_of(lens, {-half, 0}) + angle_of(lens, {half, 0});
}
double Pinhole::vfov() const {
    const double half = height / (2 * fy);
    if (!lens.bends()) return 2 * std::atan(half);
    return angle_of(lens, {0, -half}) + angle_of(lens, {0, half});
}

Pinhole::Field Pinhole::field() const {
    Field field{-(cx + 0.5) / fx, (width - 0.5 - cx) / fx, -(cy + 0.5) / fy,
                (height - 0.5 - cy) / fy};
    if (!lens.bends()) return field;
    constexpr int kSteps = 64;
    constexpr double kNone = std::numeric_limits<double>::infinity();
    Field seen{kNone, -kNone, kNone, -kNone};
    const auto take = [&](double x, double y) {
        const Eigen::Vector2d point = seen_through(lens, {x, y});
        seen.left = std::min(seen.left, point.x());
        seen.right = std::max(seen.right, point.x());
        seen.top = std::min(seen.top, point.y());
        seen.bottom = std::max(seen.bottom, point.y());
    };
    for (int i = 0; i <= kSteps; ++i) {
        const double x = field.left + i * field.width() / kSteps;
        const double y = field.top + i * (field.bottom - field.top) / kSteps;
        for (const double border : {field.top, field.bottom}) take(x, border);
        for (const double border : {field.left, field.right}) take(border, y);
    }
    return seen;
}

Pinhole Pinhole::zoomed(double factor) const {
    Pinhole camera = *this;
    camera.fx *= factor;
    camera.fy *= factor;
    return camera;
}

Pinhole Pinhole::flipped() const {
    Pinhole out = *this;
    out.cx = width - 1 - cx;
    out.skew = -skew;
    out.lens = lens.flipped();
    return out;
}

Pinhole Pinhole::resized(int new_width, int new_height) const {
    require(new_width > 0, "resized camera", "width", new_width, "at least 1 px");
    require(new_height > 0, "resized camera", "height", new_height, "at least 1 px");
    const double sx = static_cast<double>(new_width) / width;
    const double sy = static_cast<double>(new_height) / height;
    Pinhole camera;
    camera.width = new_width;
    camera.height = new_height;
    camera.fx = fx * sx;
    camera.fy = fy * sy;
    camera.cx = (cx + 0.5) * sx - 0.5;
    camera.cy = (cy + 0.5) * sy - 0.5;
    camera.skew = skew * sx;
    camera.lens = lens;
    return camera;
}

void Pinhole::validate(const char* name) const {
    require(width > 0, name, "width", width, "at least 1 px");
    require(height > 0, name, "height", height, "at least 1 px");
    require(std::isfinite(fx) && fx > 0, name, "fx", fx, "a finite number > 0 px");
    require(std::isfinite(fy) && fy > 0, name, "fy", fy, "a finite number > 0 px");
    require(std::isfinite(cx), name, "cx", cx, "a finite number of px");
    require(std::isfinite(cy), name, "cy", cy, "a finite number of px");
    require(std::isfinite(skew), name, "skew", skew, "a finite number of px");
    lens.validate(name);
}

Rig Rig::resized(int reference_width, int reference_height, int source_width,
                 int source_height) const {
    return {reference.resized(reference_width, reference_height),
            source.resized(source_width, source_height), source_from_reference, relative_depth,
            source_mirrored};
}

void RelativeDepth::validate(const char* name) const {
    require(std::isfinite(scale) && scale > 0, name, "scale", scale, "a finite number > 0");
    require(std::isfinite(shift), name, "shift", shift, "a finite number");
}

void Rig::validate() const {
    reference.validate("reference");
    source.validate("source");
    const double norm = source_from_reference.rotation.norm();
    require(std::isfinite(norm) && std::abs(norm - 1) < 1e-6, "source_from_reference",
            "norm of the quaternion", norm, "1");
    for (int i = 0; i < 3; ++i)
        require(std::isfinite(t()[i]), "source_from_reference", "translation", t()[i],
                "a finite number of metres");
    if (relative_depth) relative_depth->validate("relative_depth");
}

Eigen::Matrix3d Rig::source_K() const {
    Eigen::Matrix3d k = source.K();
    if (source_mirrored) k.col(0) = -k.col(0);
    return k;
}

Rig with_flipped_source(const Rig& rig) {
    Rig out = rig;
    out.source = rig.source.flipped();
    out.source_mirrored = !rig.source_mirrored;
    return out;
}

Rig fitted(const Rig& rig, int reference_width, int reference_height, int source_width,
           int source_height) {
    const auto same = [](const char* name, const Pinhole& camera, int width, int height) {
        const long difference = std::labs(static_cast<long>(width) * camera.height -
                                          static_cast<long>(height) * camera.width);
        if (difference > std::max(camera.width, camera.height))
            throw InputError(
                format("%s images are %dx%d, but the rig's %s camera is %dx%d;"
                       " expected that size or the same aspect",
                       name, width, height, name, camera.width, camera.height));
        return camera.width == width && camera.height == height;
    };
    const bool reference = same("reference", rig.reference, reference_width, reference_height);
    const bool source = same("source", rig.source, source_width, source_height);
    if (reference && source) return rig;
    return rig.resized(reference_width, reference_height, source_width, source_height);
}

Eigen::Vector3d unproject(const Pinhole& camera, double u, double v, double z) {
    const double y = (v - camera.cy) / camera.fy;
    const double x = (u - camera.cx - camera.skew * y) / camera.fx;
    if (!camera.lens.bends()) return {x * z, y * z, z};
    const auto point = camera.lens.undistort({x, y});
    if (!point) return Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
    return z * point->homogeneous();
}

Eigen::Vector2d project(const Pinhole& camera, const Eigen::Vector3d& x_in_camera) {
    const auto shown = camera.lens.distort(x_in_camera.hnormalized());
    if (!shown) return Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
    return {camera.fx * shown->x() + camera.skew * shown->y() + camera.cx,
            camera.fy * shown->y() + camera.cy};
}

Rig turn_source(const Rig& rig, const Eigen::Vector3d& rotation) {
    const double angle = rotation.norm();
    if (angle == 0) return rig;
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(angle, rotation / angle));
    Rig out = rig;
    out.source_from_reference.rotation = (turn * rig.source_from_reference.rotation).normalized();
    out.source_from_reference.translation = turn * rig.t();
    return out;
}

Eigen::Matrix3d infinite_homography(const Rig& rig) {
    return rig.source_K() * rig.R() * rig.reference.K().inverse();
}

Eigen::Quaterniond rotation_of(const Eigen::Matrix3d& R) {
    if (!((R * R.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-6 && R.determinant() > 0))
        throw std::invalid_argument(
            "R is not a rotation matrix (R R^T = I, det R = 1 within 1e-6)");
    return Eigen::Quaterniond(R).normalized();
}

}  // namespace xcalib

#include "xcalib/camera.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <sstream>
#include <stdexcept>

#include "format.hpp"
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

// arctan of half the vertical opening at the paper's 45 deg horizontal start.
double paper_half_vfov(int width, int height) {
    return std::atan(static_cast<double>(height) / width * std::tan(kPi / 8));
}

Pinhole pinhole_from_paper(const PaperParameters::Camera& p, int width, int height) {
    Pinhole camera;
    camera.width = width;
    camera.height = height;
    camera.fx = width / (2 * std::tan(p.fx * kPi / 8));
    camera.fy = height / (2 * std::tan(p.fy * paper_half_vfov(width, height)));
    camera.cx = p.cx * width - 0.5;
    camera.cy = p.cy * height - 0.5;
    camera.skew = p.skew;
    return camera;
}

PaperParameters::Camera paper_from_pinhole(const Pinhole& camera) {
    PaperParameters::Camera p;
    p.fx = std::atan(camera.width / (2 * camera.fx)) / (kPi / 8);
    p.fy =
        std::atan(camera.height / (2 * camera.fy)) / paper_half_vfov(camera.width, camera.height);
    p.cx = (camera.cx + 0.5) / camera.width;
    p.cy = (camera.cy + 0.5) / camera.height;
    p.skew = camera.skew;
    return p;
}

Pinhole pinhole_from_solver(const SolverParameters::Camera& p, int width, int height) {
    Pinhole camera;
    camera.width = width;
    camera.height = height;
    camera.fx = std::exp(p.log_f[0]) * width;
    camera.fy = std::exp(p.log_f[1]) * height;
    camera.cx = p.center[0] * width - 0.5;
    camera.cy = p.center[1] * height - 0.5;
    camera.skew = p.skew[0] * width;
    return camera;
}

SolverParameters::Camera solver_from_pinhole(const Pinhole& camera) {
    return {{std::log(camera.fx / camera.width), std::log(camera.fy / camera.height)},
            {(camera.cx + 0.5) / camera.width, (camera.cy + 0.5) / camera.height},
            {camera.skew / camera.width}};
}

}  // namespace

Pinhole Pinhole::from_hfov(int width, int height, double hfov) {
    require(hfov > 0 && hfov < kPi, "camera", "hfov", hfov, "an angle in (0, pi) rad");
    Pinhole camera;
    camera.width = width;
    camera.height = height;
    camera.fx = camera.fy = width / (2 * std::tan(hfov / 2));
    camera.cx = (width - 1) / 2.0;
    camera.cy = (height - 1) / 2.0;
    return camera;
}

Eigen::Matrix3d Pinhole::K() const {
    Eigen::Matrix3d k;
    k << fx, skew, cx, 0, fy, cy, 0, 0, 1;
    return k;
}

double Pinhole::hfov() const { return 2 * std::atan(width / (2 * fx)); }
double Pinhole::vfov() const { return 2 * std::atan(height / (2 * fy)); }

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
}

Rig Rig::resized(int reference_width, int reference_height, int source_width,
                 int source_height) const {
    return {reference.resized(reference_width, reference_height),
            source.resized(source_width, source_height), source_from_reference, relative_depth};
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
    return {x * z, y * z, z};
}

Eigen::Vector2d project(const Pinhole& camera, const Eigen::Vector3d& x_in_camera) {
    const double x = x_in_camera.x() / x_in_camera.z();
    const double y = x_in_camera.y() / x_in_camera.z();
    return {camera.fx * x + camera.skew * y + camera.cx, camera.fy * y + camera.cy};
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
    return rig.source.K() * rig.R() * rig.reference.K().inverse();
}

Rig rig_from_paper(const PaperParameters& parameters, int reference_width, int reference_height,
                   int source_width, int source_height) {
    const Eigen::Vector4d q = parameters.quaternion.normalized();
    Rig rig;
    rig.reference = pinhole_from_paper(parameters.reference, reference_width, reference_height);
    rig.source = pinhole_from_paper(parameters.source, source_width, source_height);
    rig.source_from_reference.rotation = Eigen::Quaterniond(q[0], q[1], q[2], q[3]);
    constexpr double kScale = kPaperTranslationScale;
    rig.source_from_reference.translation =
        parameters.translation * Eigen::Vector3d(1, kScale, kScale * kScale);
    return rig;
}

PaperParameters paper_from_rig(const Rig& rig) {
    const Eigen::Quaterniond& q = rig.source_from_reference.rotation;
    PaperParameters parameters;
    parameters.reference = paper_from_pinhole(rig.reference);
    parameters.source = paper_from_pinhole(rig.source);
    parameters.quaternion = {q.w(), q.x(), q.y(), q.z()};
    parameters.translation.col(0) = rig.t();
    return parameters;
}

SolverParameters solver_from_rig(const Rig& rig) {
    const Eigen::Quaterniond& q = rig.source_from_reference.rotation;
    return {solver_from_pinhole(rig.reference),
            solver_from_pinhole(rig.source),
            {q.w(), q.x(), q.y(), q.z()},
            {rig.t().x(), rig.t().y(), rig.t().z()}};
}

Rig rig_from_solver(const SolverParameters& parameters, int reference_width, int reference_height,
                    int source_width, int source_height) {
    const double* q = parameters.quaternion;
    const double* t = parameters.translation;
    Rig rig;
    rig.reference = pinhole_from_solver(parameters.reference, reference_width, reference_height);
    rig.source = pinhole_from_solver(parameters.source, source_width, source_height);
    rig.source_from_reference.rotation = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized();
    rig.source_from_reference.translation = Eigen::Vector3d(t[0], t[1], t[2]);
    return rig;
}

}  // namespace xcalib

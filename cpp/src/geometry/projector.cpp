#include "geometry/projector.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/kernel_targets.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "geometry/projector.cpp"
#include <hwy/foreach_target.h>
// After it.
#include "geometry/projector-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace xcalib {
namespace HWY_NAMESPACE {
namespace {

void map_row(const Projector& projector, const float* depth, int y, int width, float* u, float* v,
             std::uint8_t* validity) {
    const Row row(projector.to_image, y);
    const Float none = set(std::numeric_limits<double>::quiet_NaN());
    Float along = hn::Iota(FloatTag(), 0.0f);
    for (int x = 0; x < width; x += kLanes, along = hn::Add(along, set(double{kLanes}))) {
        const int left = width - x;
        const Float metres = load(depth + x, left);
        Points p = project<true>(row, metres, along);
        const Mask valid = confine(projector, metres, p);
        store(hn::IfThenElse(valid, p.u, none), u + x, left);
        store(hn::IfThenElse(valid, p.v, none), v + x, left);
        HWY_ALIGN std::int32_t codes[kLanes];
        hn::Store(codes_of(metres, valid), IntTag(), codes);
        for (int i = 0; i < std::min(kLanes, left); ++i)
            validity[x + i] = static_cast<std::uint8_t>(codes[i]);
    }
}

void seen_row(const Projector& projector, const float* depth, int y, int width, SeenRow& out) {
    const FloatTag d;
    const Row row(projector.to_camera, y);
    const Row rays({projector.to_ray, Eigen::Vector3d::Zero()}, y);
    Float along = hn::Iota(d, 0.0f);
    for (int x = 0; x < width; x += kLanes, along = hn::Add(along, set(double{kLanes}))) {
        const Float metres = load(depth + x, width - x);
        const Float rx = hn::Mul(metres, hn::MulAdd(row.ax, along, row.bx));
        const Float ry = hn::Mul(metres, hn::MulAdd(row.ay, along, row.by));
        const Float rz = hn::Mul(metres, hn::MulAdd(row.az, along, row.bz));
        const Float inverse_z = reciprocal<true>(hn::Add(rz, row.kz));
        const auto put = [&](Float value, std::vector<float>& part)
                             HWY_ATTR { hn::StoreU(value, d, part.data() + x); };
        put(hn::MulAdd(rays.ax, along, rays.bx), out.ray_x);
        put(rays.by, out.ray_y);
        put(rx, out.rx);
        put(ry, out.ry);
        put(rz, out.rz);
        put(hn::Mul(hn::Add(rx, row.kx), inverse_z), out.x);
        put(hn::Mul(hn::Add(ry, row.ky), inverse_z), out.y);
        put(inverse_z, out.inverse_z);
    }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace xcalib
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace xcalib {
namespace {

HWY_EXPORT(map_row);
HWY_EXPORT(seen_row);

}  // namespace

Projector::Projector(const Rig& rig)
    : to_image{infinite_homography(rig), rig.source_K() * rig.t()},
      to_camera{rig.R() * rig.reference.K().inverse(), rig.t()},
      to_ray(rig.reference.K().inverse()), source_width(rig.source.width),
      source_height(rig.source.height) {}

double Projector::step_along_row(int x, int y) const {
    const Eigen::Matrix3d& h = to_image.m;
    const double u = h(0, 1) * y + h(0, 2), z = h(2, 1) * y + h(2, 2);
    const double depth = h(2, 0) * x + z;
    return std::abs(h(0, 0) * z - h(2, 0) * u) / (depth * depth);
}

float Projector::least_depth(int y, int width) const {
    const Eigen::Matrix3d& h = to_image.m;
    const double constant = h(2, 1) * y + h(2, 2);
    const double slowest = constant + std::min(0.0, h(2, 0) * (width - 1));  // z by depth
    if (!(slowest > 0)) return std::numeric_limits<float>::max();
    const double depth = std::max(kNearestZ, (kNearestZ - to_image.c.z()) / slowest);
    return static_cast<float>(std::min<double>(1.0001 * depth, std::numeric_limits<float>::max()));
}

Eigen::Vector2d transfer(const Rig& rig, double x, double y, double depth) {
    if (depth > 0) {
        const Eigen::Vector3d point = rig.R() * unproject(rig.reference, x, y, depth) + rig.t();
        if (point.z() > kNearestZ) return (rig.source_K() * point).hnormalized();
    }
    return Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
}

SeenPoint seen_point(const Rig& rig, double x, double y, double depth) {
    const Eigen::Vector3d ray = unproject(rig.reference, x, y, 1);
    const Eigen::Vector3d turned = rig.R() * (depth * ray), point = turned + rig.t();
    const Eigen::Vector2f seen = point.hnormalized().cast<float>();
    const auto single = [](double value) { return static_cast<float>(value); };
    return {single(ray.x()),    single(ray.y()), single(turned.x()), single(turned.y()),
            single(turned.z()), seen.x(),        seen.y(),           single(1 / point.z())};
}

void map_row(const Projector& projector, const float* depth, int y, int width, float* u, float* v,
             std::uint8_t* validity) {
    HWY_DYNAMIC_DISPATCH(map_row)(projector, depth, y, width, u, v, validity);
}

void seen_row(const Projector& projector, const float* depth, int y, int width, SeenRow& out) {
    HWY_DYNAMIC_DISPATCH(seen_row)(projector, depth, y, width, out);
}

}  // namespace xcalib
#endif

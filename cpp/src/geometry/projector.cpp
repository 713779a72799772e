#include "geometry/projector.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

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
    const AnyRow row(projector, y);
    const Float none = set(std::numeric_limits<double>::quiet_NaN());
    Float along = hn::Iota(FloatTag(), 0.0f);
    for (int x = 0; x < width; x += kLanes, along = hn::Add(along, set(double{kLanes}))) {
        const int left = width - x;
        const Float metres = load(depth + x, left);
        Points p = project<true>(row, metres, along, x);
        const Mask valid = confine(projector, metres, p);
        store(hn::IfThenElse(valid, p.u, none), u + x, left);
        store(hn::IfThenElse(valid, p.v, none), v + x, left);
        HWY_ALIGN std::int32_t codes[kLanes];
        hn::Store(codes_of(metres, valid), IntTag(), codes);
        for (int i = 0; i < std::min(kLanes, left); ++i)
            validity[x + i] = static_cast<std::uint8_t>(codes[i]);
    }
}

// What the lenses do at the points of a row of which the rest is known.
void bend_row(const Projector& projector, int y, int width, SeenRow& out) {
    const FloatTag d;
    for (auto* part : {&out.shown_x, &out.shown_y, &out.source.xx, &out.source.xy, &out.source.yy,
                       &out.reference.xx, &out.reference.xy, &out.reference.yy})
        part->resize(out.x.size());
    const VectorLens source(projector.source_lens), reference(projector.reference_lens);
    for (int x = 0; x < width; x += kLanes) {
        const auto put = [&](Float value, std::vector<float>& part)
                             HWY_ATTR { hn::StoreU(value, d, part.data() + x); };
        const auto put_slope = [&](const VectorSlope& slope, SeenRow::Slopes& slopes) HWY_ATTR {
            put(slope.xx, slopes.xx);
            put(slope.xy, slopes.xy);
            put(slope.yy, slopes.yy);
        };
        const Float at_x = load(out.x.data() + x), at_y = load(out.y.data() + x);
        const Shown shown = shown_by(source, at_x, at_y);
        put(shown.x, out.shown_x);
        put(shown.y, out.shown_y);
        put_slope(slope_of(source, at_x, at_y), out.source);
        VectorSlope slope{set(1.0), hn::Zero(d), set(1.0)};
        if (projector.rays) {  // the inverse, for the ray is known and the pixel given
            const VectorSlope shows = slope_of(reference, load(projector.rays->row_x(y) + x),
                                               load(projector.rays->row_y(y) + x));
            const Float per =
                hn::Div(set(1.0), hn::MulSub(shows.xx, shows.yy, hn::Mul(shows.xy, shows.xy)));
            slope = {hn::Mul(shows.yy, per), hn::Neg(hn::Mul(shows.xy, per)),
                     hn::Mul(shows.xx, per)};
        }
        put_slope(slope, out.reference);
    }
}

void seen_row(const Projector& projector, const float* depth, int y, int width, SeenRow& out) {
    const FloatTag d;
    const Row row(projector.to_camera, y);
    const Row rays({projector.to_ray, Eigen::Vector3d::Zero()}, y);
    Float along = hn::Iota(d, 0.0f);
    for (int x = 0; x < width; x += kLanes, along = hn::Add(along, set(double{kLanes}))) {
        const Float metres = load(depth + x, width - x);
        Float rx, ry, rz;
        if (projector.rays) {
            const Float ray_x = load(projector.rays->row_x(y) + x);
            const Float ray_y = load(projector.rays->row_y(y) + x);
            const auto turned = [&](int i) HWY_ATTR {
                const auto m = [&](int k) HWY_ATTR { return set(projector.to_camera.m(i, k)); };
                return hn::Mul(metres, hn::MulAdd(m(0), ray_x, hn::MulAdd(m(1), ray_y, m(2))));
            };
            rx = turned(0);
            ry = turned(1);
            rz = turned(2);
        } else {
            rx = hn::Mul(metres, hn::MulAdd(row.ax, along, row.bx));
            ry = hn::Mul(metres, hn::MulAdd(row.ay, along, row.by));
            rz = hn::Mul(metres, hn::MulAdd(row.az, along, row.bz));
        }
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
    if (projector.bends()) bend_row(projector, y, width, out);
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
      source_height(rig.source.height), source_K(rig.source_K()), source_lens(rig.source_lens()),
      reference_lens(rig.reference.lens) {
    if (!reference_lens.bends()) return;
    rays = rays_of(rig.reference);
    to_image.m = source_K * rig.R();
    to_camera.m = rig.R();
}

double Projector::step_along_row(int x, int y) const {
    if (bends()) {
        const auto at = [&](int column) -> std::optional<Eigen::Vector2d> {
            Eigen::Vector3d from(column, y, 1);
            if (rays && column >= rays->width) return std::nullopt;
            if (rays) from = {rays->row_x(y)[column], rays->row_y(y)[column], 1};
            const auto shown = source_lens.distort((to_camera.m * from).hnormalized());
            if (!shown) return std::nullopt;
            return (source_K * shown->homogeneous()).head<2>();
        };
        const auto here = at(x), next = at(x + 1);
        const double step = here && next ? std::abs((*next - *here).x()) : 0;
        return step > 0 ? step : 0;  // of NaN
    }
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
        if (point.z() > kNearestZ) {
            if (!rig.source.lens.bends()) return (rig.source_K() * point).hnormalized();
            if (const auto shown = rig.source_lens().distort(point.hnormalized()))
                return (rig.source_K() * shown->homogeneous()).head<2>();
        }
    }
    return Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
}

SeenPoint seen_point(const Rig& rig, double x, double y, double depth) {
    const Eigen::Vector3d ray = unproject(rig.reference, x, y, 1);
    const Eigen::Vector3d turned = rig.R() * (depth * ray), point = turned + rig.t();
    const Eigen::Vector2d seen = point.hnormalized();
    const auto single = [](double value) { return static_cast<float>(value); };
    SeenPoint out{single(ray.x()),    single(ray.y()),  single(turned.x()), single(turned.y()),
                  single(turned.z()), single(seen.x()), single(seen.y()),   single(1 / point.z()),
                  single(seen.x()),   single(seen.y())};
    const auto slope = [&](const Eigen::Matrix2d& d) {
        return LensSlope{single(d(0, 0)), single(d(0, 1)), single(d(1, 1))};
    };
    if (const Lens& lens = rig.reference.lens; lens.bends()) {
        const auto shown = lens.distort(ray.head<2>());
        out.ray_x = shown ? single(shown->x()) : NAN;
        out.ray_y = shown ? single(shown->y()) : NAN;
        out.reference = slope(lens.derivative(ray.head<2>()).inverse());
    }
    if (const Lens lens = rig.source_lens(); lens.bends()) {
        const auto shown = lens.distort(seen);
        out.shown_x = shown ? single(shown->x()) : NAN;
        out.shown_y = shown ? single(shown->y()) : NAN;
        out.source = slope(lens.derivative(seen));
    }
    return out;
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

#include "xcalib/transfer.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "geometry/projector.hpp"

namespace xcalib {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kOneSurface = 1.1;     // depths of one surface, from one pixel to the next
constexpr double kNearestPlane = 1e-3;  // to the source camera's plane [m]
constexpr double kOnBorder = 1e-6;      // rounding of a point on the border of a triangle

bool is_inside(const Vector2d& p, const Pinhole& camera) {
    return p.x() >= 0 && p.y() >= 0 && p.x() <= camera.width - 1 && p.y() <= camera.height - 1;
}

// The source's pixel of a point in its camera's axes; NaN where it has none.
Vector2d source_pixel(const Rig& rig, const Vector3d& x_in_source) {
    if (!(x_in_source.z() > kNearestPlane)) return Vector2d::Constant(kNaN);
    const auto shown = rig.source_lens().distort(x_in_source.head<2>() / x_in_source.z());
    if (!shown) return Vector2d::Constant(kNaN);
    return (rig.source_K() * shown->homogeneous()).head<2>();
}

}  // namespace

TransferredPoint transfer(const Rig& rig, const Vector2d& pixel, double depth) {
    TransferredPoint out;
    out.depth = depth;
    if (!(depth > 0) || !std::isfinite(depth)) {
        out.code = Transferred::no_depth;
        return out;
    }
    const Vector3d x_in_reference = unproject(rig.reference, pixel.x(), pixel.y(), depth);
    out.point = source_pixel(rig, rig.R() * x_in_reference + rig.t());
    if (!is_inside(out.point, rig.source)) out.code = Transferred::outside;
    return out;
}

TransferredPoint transfer_back(const Rig& rig, const Vector2d& pixel, double depth) {
    TransferredPoint out;
    out.depth = depth;
    if (!(depth > 0) || !std::isfinite(depth)) {
        out.code = Transferred::no_depth;
        return out;
    }
    out.code = Transferred::outside;
    const Vector3d at = rig.source_K().inverse() * pixel.homogeneous();
    const auto ray = rig.source_lens().undistort(at.head<2>());
    if (!ray) return out;
    // X_R = R^T (s r - t), of which z is the depth.
    const Vector3d towards = rig.R().transpose() * ray->homogeneous();
    const Vector3d start = rig.R().transpose() * rig.t();
    const double s = (depth + start.z()) / towards.z();
    if (!(s > kNearestPlane)) return out;
    out.point = project(rig.reference, s * towards - start);
    if (is_inside(out.point, rig.reference)) out.code = Transferred::valid;
    return out;
}

// Cells of two by two reference pixels, as the source sees them: two triangles each. Buckets over
// the source image hold the cells that touch them, so that a point looks at few.
struct FrameTransfer::Surface {
    static constexpr int kBucket = 4;  // side [px]

    struct Seen {
        float u, v, z;  // source pixel, depth in the source camera; NaN where none
    };
    struct Hit {
        double z;
        Vector2d pixel;
        bool torn;  // of a cell between two surfaces
    };

    Rig rig;
    Image depth;  // of the reference's size
    std::vector<Seen> seen;
    int columns, rows;  // of buckets
    std::vector<std::uint32_t> begin, cells;

    Surface(const Rig& given, const ImageView& map) : rig(given) {
        rig.validate();
        const int width = rig.reference.width, height = rig.reference.height;
        if (map.type != PixelType::f32 || map.channels != 1)
            throw std::invalid_argument("depth is not of one channel of float32 [m]");
        require_same_aspect("depth", map.width, map.height, width, height);
        depth = resize_depth(clean_depth(map), width, height);
        seen.resize(depth.pixels.size());
        const Eigen::Matrix3d K = rig.source_K();
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x) seen[index(x, y)] = look(K, x, y);
        fill_buckets();
    }

    std::size_t index(int x, int y) const {
        return static_cast<std::size_t>(y) * static_cast<std::size_t>(depth.width) +
               static_cast<std::size_t>(x);
    }

    Seen look(const Eigen::Matrix3d& K, int x, int y) const {
        const float NaN = std::numeric_limits<float>::quiet_NaN();
        const float z = depth.row(y)[x];
        if (!(z > 0)) return {NaN, NaN, NaN};
        const SeenPoint p = seen_point(rig, x, y, z);
        if (!(p.inverse_z > 0) || p.inverse_z > 1 / kNearestPlane) return {NaN, NaN, NaN};
        const Vector3d at = K * Vector3d(p.shown_x, p.shown_y, 1);
        return {static_cast<float>(at.x()), static_cast<float>(at.y()), 1 / p.inverse_z};
    }

    // The corners of a cell, by its first pixel.
    std::array<std::size_t, 4> corners(std::size_t cell) const {
        const auto row = static_cast<std::size_t>(depth.width);
        return {cell, cell + 1, cell + row, cell + row + 1};
    }

    // The buckets that a cell touches: columns from, to, rows from, to; none where a corner is not
    // known.
    bool span(std::size_t cell, std::array<int, 4>& out) const {
        float left = INFINITY, right = -INFINITY, top = INFINITY, bottom = -INFINITY;
        for (const std::size_t i : corners(cell)) {
            if (!(std::isfinite(seen[i].u) && std::isfinite(seen[i].v))) return false;
            left = std::min(left, seen[i].u), right = std::max(right, seen[i].u);
            top = std::min(top, seen[i].v), bottom = std::max(bottom, seen[i].v);
        }
        if (right < 0 || bottom < 0 || left > static_cast<float>(rig.source.width) ||
            top > static_cast<float>(rig.source.height))
            return false;
        const auto bucket = [](float value, int count) {
            return static_cast<int>(
                std::clamp(value / kBucket, 0.0f, static_cast<float>(count - 1)));
        };
        out = {bucket(left, columns), bucket(right, columns), bucket(top, rows),
               bucket(bottom, rows)};
        return true;
    }

    template <class Use>
    void each_cell(const Use& use) const {
        std::array<int, 4> box;
        for (int y = 0; y + 1 < depth.height; ++y)
            for (int x = 0; x + 1 < depth.width; ++x)
                if (span(index(x, y), box))
                    for (int row = box[2]; row <= box[3]; ++row)
                        for (int column = box[0]; column <= box[1]; ++column)
                            use(static_cast<std::size_t>(row * columns + column), index(x, y));
    }

    void fill_buckets() {
        columns = rig.source.width / kBucket + 1;
        rows = rig.source.height / kBucket + 1;
        begin.assign(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows) + 1, 0);
        each_cell([&](std::size_t bucket, std::size_t) { ++begin[bucket + 1]; });
        for (std::size_t i = 1; i < begin.size(); ++i) begin[i] += begin[i - 1];
        cells.resize(begin.back());
        std::vector<std::uint32_t> next(begin.begin(), begin.end() - 1);
        each_cell([&](std::size_t bucket, std::size_t cell) {
            cells[next[bucket]++] = static_cast<std::uint32_t>(cell);
        });
    }

    // Every surface that the source could see at a pixel within its image, were it transparent.
    template <class Use>
    void each_hit(const Vector2d& p, const Use& use) const {
        const int column = std::min(static_cast<int>(p.x()) / kBucket, columns - 1);
        const int row = std::min(static_cast<int>(p.y()) / kBucket, rows - 1);
        const auto bucket = static_cast<std::size_t>(row * columns + column);
        for (std::uint32_t i = begin[bucket]; i < begin[bucket + 1]; ++i) {
            const std::array<std::size_t, 4> c = corners(cells[i]);
            if (!hit({c[0], c[1], c[2]}, p, use)) hit({c[3], c[2], c[1]}, p, use);
        }
    }

    template <class Use>
    bool hit(const std::array<std::size_t, 3>& t, const Vector2d& p, const Use& use) const {
        const Seen &a = seen[t[0]], &b = seen[t[1]], &c = seen[t[2]];
        const double bu = b.u - a.u, bv = b.v - a.v, cu = c.u - a.u, cv = c.v - a.v;
        const double area = bu * cv - bv * cu;
        if (area == 0) return false;
        const double pu = p.x() - a.u, pv = p.y() - a.v;
        const double wb = (pu * cv - pv * cu) / area, wc = (bu * pv - bv * pu) / area;
        if (wb < -kOnBorder || wc < -kOnBorder || wb + wc > 1 + kOnBorder) return false;
        const auto width = static_cast<std::size_t>(depth.width);
        Vector2d pixel(0, 0);
        const double weights[] = {1 - wb - wc, wb, wc};
        float near = INFINITY, far = 0;
        double inverse_z = 0;
        for (int k = 0; k < 3; ++k) {
            pixel += weights[k] *
                     Vector2d(static_cast<double>(t[k] % width), static_cast<double>(t[k] / width));
            inverse_z += weights[k] / seen[t[k]].z;
            near = std::min(near, depth.pixels[t[k]]);
            far = std::max(far, depth.pixels[t[k]]);
        }
        use(Hit{1 / inverse_z, pixel, far > kOneSurface * near});
        return true;
    }
};

FrameTransfer::FrameTransfer(const Rig& rig, const ImageView& depth)
    : surface_(std::make_unique<Surface>(rig, depth)) {}
FrameTransfer::~FrameTransfer() = default;
FrameTransfer::FrameTransfer(FrameTransfer&&) noexcept = default;
FrameTransfer& FrameTransfer::operator=(FrameTransfer&&) noexcept = default;

double FrameTransfer::depth_at(const Vector2d& pixel) const {
    const Image& depth = surface_->depth;
    if (!is_inside(pixel, surface_->rig.reference)) return 0;
    const int x = std::min(static_cast<int>(pixel.x()), std::max(0, depth.width - 2));
    const int y = std::min(static_cast<int>(pixel.y()), std::max(0, depth.height - 2));
    const int right = std::min(x + 1, depth.width - 1), below = std::min(y + 1, depth.height - 1);
    const double fx = pixel.x() - x, fy = pixel.y() - y;
    const float near[] = {depth.row(y)[x], depth.row(y)[right], depth.row(below)[x],
                          depth.row(below)[right]};
    const auto [low, high] = std::minmax_element(std::begin(near), std::end(near));
    if (*low > 0 && *high <= kOneSurface * *low)
        return 1 / ((1 - fy) * ((1 - fx) / near[0] + fx / near[1]) +
                    fy * ((1 - fx) / near[2] + fx / near[3]));
    return near[(fy >= 0.5 ? 2 : 0) + (fx >= 0.5 ? 1 : 0)];
}

TransferredPoint FrameTransfer::to_source(const Vector2d& pixel) const {
    const Rig& rig = surface_->rig;
    if (!is_inside(pixel, rig.reference)) {
        TransferredPoint out;
        out.code = Transferred::outside;
        return out;
    }
    TransferredPoint out = transfer(rig, pixel, depth_at(pixel));
    if (out.code != Transferred::valid) return out;
    const Vector3d x = unproject(rig.reference, pixel.x(), pixel.y(), out.depth);
    const double z = (rig.R() * x + rig.t()).z();
    surface_->each_hit(out.point, [&](const Surface::Hit& hit) {
        if (!hit.torn && kOneSurface * hit.z < z) out.code = Transferred::occluded;
    });
    return out;
}

TransferredPoint FrameTransfer::to_reference(const Vector2d& pixel) const {
    TransferredPoint out;
    out.code = Transferred::outside;
    if (!is_inside(pixel, surface_->rig.source)) return out;
    double nearest = std::numeric_limits<double>::infinity();
    bool torn = false;
    surface_->each_hit(pixel, [&](const Surface::Hit& hit) {
        torn = torn || hit.torn;
        if (hit.torn || !(hit.z < nearest)) return;
        nearest = hit.z;
        out.point = hit.pixel;
    });
    if (std::isfinite(nearest)) {
        out.depth = depth_at(out.point);
        out.code = Transferred::valid;
    } else if (torn) {
        out.code = Transferred::ambiguous;
    }
    return out;
}

std::vector<float> FrameTransfer::inverse_map() const {
    const Pinhole& source = surface_->rig.source;
    std::vector<float> out;
    out.reserve(2 * static_cast<std::size_t>(source.width) *
                static_cast<std::size_t>(source.height));
    for (int y = 0; y < source.height; ++y)
        for (int x = 0; x < source.width; ++x) {
            const TransferredPoint p = to_reference(Vector2d(x, y));
            out.push_back(static_cast<float>(p.point.x()));
            out.push_back(static_cast<float>(p.point.y()));
        }
    return out;
}

}  // namespace xcalib

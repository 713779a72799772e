#include "geometry/rays.hpp"

#include <limits>
#include <list>
#include <mutex>
#include <utility>

namespace xcalib {
namespace {

bool same(const Pinhole& a, const Pinhole& b) {
    return a.width == b.width && a.height == b.height && a.fx == b.fx && a.fy == b.fy &&
           a.cx == b.cx && a.cy == b.cy && a.skew == b.skew && a.lens == b.lens;
}

}  // namespace

Rays::Rays(const Pinhole& camera)
    : width(camera.width), height(camera.height),
      x(stride() * height, std::numeric_limits<float>::quiet_NaN()), y(x) {
    for (int row = 0; row < height; ++row)
        for (int column = 0; column < width; ++column) {
            const Eigen::Vector3d ray = unproject(camera, column, row, 1);
            x[row * stride() + column] = static_cast<float>(ray.x());
            y[row * stride() + column] = static_cast<float>(ray.y());
        }
}

std::shared_ptr<const Rays> rays_of(const Pinhole& camera) {
    constexpr std::size_t kKept = 4;  // the levels of a pyramid
    using Table = std::shared_ptr<const Rays>;
    static std::mutex mutex;
    static std::list<std::pair<Pinhole, Table>> kept;  // those asked for last come first
    const std::lock_guard lock(mutex);
    for (auto entry = kept.begin(); entry != kept.end(); ++entry)
        if (same(entry->first, camera)) {
            kept.splice(kept.begin(), kept, entry);
            return entry->second;
        }
    kept.emplace_front(camera, std::make_shared<const Rays>(camera));
    if (kept.size() > kKept) kept.pop_back();
    return kept.front().second;
}

}  // namespace xcalib

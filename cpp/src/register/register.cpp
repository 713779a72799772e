#include "xcalib/register.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>
#include <mutex>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "base/parallel.hpp"
#include "base/workers.hpp"
#include "register/register_rows.hpp"
#include "xcalib/threads.hpp"

namespace xcalib {
namespace {

// One copy of the cells a thread: each costs memory, and to join them costs time.
constexpr int kMaxParts = 8;
// Rows that a thread takes at a time, so that one that is held up keeps no other waiting.
constexpr int kRows = 32;
// The kernel's floats count whole pixels up to here.
constexpr int kMaxSourcePixels = 4000000;

void require_size(const char* name, int width, int height, const Pinhole& camera) {
    if (width == camera.width && height == camera.height) return;
    std::ostringstream message;
    message << name << " is " << width << "x" << height << ", expected the rig's " << camera.width
            << "x" << camera.height;
    throw std::invalid_argument(message.str());
}

Image in_metres(const DepthView& depth) {
    if (depth.view.type == PixelType::f32) return clean_depth(depth.view);
    Image out(depth.view.width, depth.view.height);
    for (int y = 0; y < out.height; ++y) {
        const std::uint16_t* units = depth.view.row<std::uint16_t>(y);
        for (int x = 0; x < out.width; ++x) out.row(y)[x] = depth.scale * units[x];
    }
    return out;
}

// Where the source has no number, or is made of one that is none, it has no value: as outside of
// it.
void drop_not_finite(const MutableImageView& image, int begin, int end, std::uint8_t* mask) {
    constexpr std::uint32_t kExponent = 0x7f800000;  // all of its bits: infinite, or not a number
    const int values = image.width * image.channels;
    const auto is_finite = [](float value) {
        std::uint32_t bits;
        std::memcpy(&bits, &value, sizeof bits);
        return (bits & kExponent) != kExponent;
    };
    for (int y = begin; y < end; ++y) {
        auto* row = reinterpret_cast<float*>(static_cast<char*>(image.data) + y * image.row_bytes);
        int bad = 0;
        for (int i = 0; i < values; ++i) bad |= !is_finite(row[i]);
        if (!bad) continue;
        std::uint8_t* codes = mask + static_cast<std::size_t>(y) * image.width;
        for (int x = 0; x < image.width; ++x) {
            float* pixel = row + x * image.channels;
            if (std::all_of(pixel, pixel + image.channels, is_finite)) continue;
            std::fill_n(pixel, image.channels, 0.0f);
            if (codes[x] == static_cast<std::uint8_t>(Validity::valid))
                codes[x] = static_cast<std::uint8_t>(Validity::outside);
        }
    }
}

}  // namespace

void RegistrarOptions::validate() const {
    std::ostringstream message;
    if (num_threads < 0 || num_threads > kMaxThreads)
        message << "num_threads is " << num_threads << ", expected 0 (every core) to "
                << kMaxThreads;
    else if (!(depth_scale >= 0) || !std::isfinite(depth_scale))
        message << "depth_scale is " << depth_scale
                << ", expected metres per unit of uint16 depth, or 0 to refuse it";
    else return;
    throw std::invalid_argument(message.str());
}

struct Registrar::Stream {
    // The cells of the parts one after the other, then those of all.
    using Cells = std::vector<Nearness>;

    Rig rig;
    RegistrarOptions options;
    Projector projector;
    CellGrid grid;
    int parts;
    bool occlusion;
    Workers workers;
    std::mutex mutex;
    std::vector<std::unique_ptr<Cells>> spare;  // one for each call that there was at a time

    Stream(const Rig& for_rig, const RegistrarOptions& with)
        : rig(for_rig), options(with), projector(rig), grid(rig),
          parts(std::min(resolve_threads(options.num_threads), kMaxParts)),
          // Cameras at one place see the same.
          occlusion(options.occlusion != Occlusion::ignore && rig.t().norm() > 0),
          workers(resolve_threads(options.num_threads)) {
        if (occlusion) give_back(take());  // for the first frame
    }

    std::unique_ptr<Cells> take() {
        {
            const std::lock_guard lock(mutex);
            if (!spare.empty()) {
                std::unique_ptr<Cells> cells = std::move(spare.back());
                spare.pop_back();
                return cells;
            }
        }
        return std::make_unique<Cells>((parts + 1) * cells_with_room(grid));
    }

    void give_back(std::unique_ptr<Cells> cells) {
        const std::lock_guard lock(mutex);
        spare.push_back(std::move(cells));
    }

    // Splats all of the depth, then calls work(cells, begin, end) on all rows of the reference.
    // `cells` is null where nothing can be hidden, or nobody asks.
    template <class Work>
    void each_row(const DepthView& depth, bool asked, const Work& work) {
        std::unique_ptr<Cells> cells;
        const Nearness* joined = nullptr;
        const int height = depth.view.height;
        const auto in_rows = [&](int rows, const auto& work_on) {
            workers.each((rows + kRows - 1) / kRows, [&](int part) {
                work_on(part * kRows, std::min(rows, (part + 1) * kRows));
            });
        };
        if (occlusion && asked) {
            cells = take();
            const std::size_t size = cells_with_room(grid);
            std::atomic<int> next{0};
            workers.each(parts, [&](int part) {
                Nearness* own = cells->data() + part * size;
                std::fill_n(own, size, Nearness{0});
                for (int y = next.fetch_add(kRows); y < height; y = next.fetch_add(kRows))
                    splat_rows(projector, depth, grid, y, std::min(height, y + kRows), own);
            });
            Nearness* out = cells->data() + parts * size;
            in_rows(grid.height, [&](int begin, int end) {
                join_cells(grid, cells->data(), parts, begin, end, out);
            });
            joined = out;
        }
        in_rows(height, [&](int begin, int end) { work(joined, begin, end); });
        if (cells) give_back(std::move(cells));
    }
};

Registrar::Registrar(const Rig& rig, const RegistrarOptions& options) {
    rig.validate();
    options.validate();
    if (rig.source.width < 2 || rig.source.height < 2)
        throw std::invalid_argument("source is narrower than 2 px, too small to interpolate");
    if (std::max(rig.source.width, rig.source.height) > kMaxSourcePixels) {
        std::ostringstream message;
        message << "source is " << rig.source.width << "x" << rig.source.height
                << ", expected at most " << kMaxSourcePixels << " px a side";
        throw std::invalid_argument(message.str());
    }
    stream_ = std::make_unique<Stream>(rig, options);
}

Registrar::~Registrar() = default;
Registrar::Registrar(Registrar&&) noexcept = default;
Registrar& Registrar::operator=(Registrar&&) noexcept = default;

const Rig& Registrar::rig() const { return stream_->rig; }
const RegistrarOptions& Registrar::options() const { return stream_->options; }

namespace {

// The depth on the reference's grid: as given where it has that size, else resized into `room`.
DepthView on_grid(const ImageView& depth, double scale, const Pinhole& grid, Image& room) {
    require_same_aspect("depth", depth.width, depth.height, grid.width, grid.height);
    const bool metres = depth.type == PixelType::f32;
    const bool units = depth.type == PixelType::u16 && scale > 0;
    if (depth.channels != 1 || !(metres || units))
        throw std::invalid_argument(
            "depth must be one float32 channel in metres, or uint16 with depth_scale given");
    const DepthView given{depth, metres ? 1.0f : static_cast<float>(scale)};
    if (depth.width == grid.width && depth.height == grid.height) return given;
    room = resize_depth(in_metres(given), grid.width, grid.height);
    return {room.view(), 1.0f};
}

}  // namespace

void Registrar::map(const ImageView& depth, float* out) const {
    Image room;
    RowsTask task{};
    task.projector = &stream_->projector;
    task.depth = on_grid(depth, options().depth_scale, rig().reference, room);
    task.grid = &stream_->grid;
    task.hide = options().occlusion == Occlusion::hide;
    stream_->each_row(task.depth, task.hide, [&](const Nearness* cells, int begin, int end) {
        RowsTask part = task;
        part.cells = cells;
        map_rows(part, begin, end, out);
    });
}

void Registrar::register_frame(const ImageView& source, const ImageView& depth,
                               const MutableImageView& registered, std::uint8_t* mask) const {
    require_size("source", source.width, source.height, rig().source);
    require_size("registered", registered.width, registered.height, rig().reference);
    if (registered.type != source.type || registered.channels != source.channels)
        throw std::invalid_argument("registered must have the source's pixel type and channels");
    if (std::abs(source.row_bytes) > std::numeric_limits<std::int32_t>::max() / source.height)
        throw std::invalid_argument("source takes more than 2 GiB, expected less");
    Image room;
    RowsTask task{};
    task.projector = &stream_->projector;
    task.depth = on_grid(depth, options().depth_scale, rig().reference, room);
    task.grid = &stream_->grid;
    task.hide = options().occlusion == Occlusion::hide;
    task.source = source;
    task.nearest = options().nearest;
    task.registered = registered;
    task.mask = mask;
    stream_->each_row(task.depth, true, [&](const Nearness* cells, int begin, int end) {
        RowsTask part = task;
        part.cells = cells;
        register_rows(part, begin, end);
        if (source.type == PixelType::f32) drop_not_finite(registered, begin, end, mask);
    });
}

}  // namespace xcalib

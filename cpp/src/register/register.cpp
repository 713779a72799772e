#include "xcalib/register.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
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
    // What a frame needs besides: one for each call that there was at a time.
    struct Scratch {
        // Those of the parts one after the other, then those of all.
        std::vector<Nearness> cells;
        DepthRows depth;
        std::vector<DepthRows::Room> rooms;  // one a thread
        std::vector<HiddenRoom> hidden;      // also one a thread
    };

    Rig rig;
    RegistrarOptions options;
    Projector projector;
    CellGrid grid;
    int threads;
    int parts;
    bool occlusion;
    RowGrid row_grid;
    Workers workers;
    std::mutex mutex;
    std::vector<std::unique_ptr<Scratch>> spare;

    Stream(const Rig& for_rig, const RegistrarOptions& with)
        : rig(for_rig), options(with), projector(rig), grid(rig),
          threads(resolve_threads(options.num_threads)), parts(std::min(threads, kMaxParts)),
          // Cameras at one place see the same.
          occlusion(options.occlusion != Occlusion::ignore && rig.t().norm() > 0),
          row_grid(occlusion ? RowGrid(rig) : RowGrid()), workers(threads) {
        give_back(take());  // for the first frame
    }

    std::unique_ptr<Scratch> take() {
        {
            const std::lock_guard lock(mutex);
            if (!spare.empty()) {
                std::unique_ptr<Scratch> scratch = std::move(spare.back());
                spare.pop_back();
                return scratch;
            }
        }
        auto scratch = std::make_unique<Scratch>();
        scratch->rooms.resize(threads);
        scratch->hidden.resize(threads);
        if (!occlusion) return scratch;
        if (!row_grid.serves) scratch->cells.resize((parts + 1) * cells_with_room(grid));
        else
            for (HiddenRoom& room : scratch->hidden) room.keep(rig.reference.width, row_grid);
        return scratch;
    }

    void give_back(std::unique_ptr<Scratch> scratch) {
        const std::lock_guard lock(mutex);
        spare.push_back(std::move(scratch));
    }

    // Calls work(part, begin, end) on all of so many rows, a thread a part, some at a time.
    template <class Work>
    void share_out(int num_parts, int rows, int at_a_time, const Work& work) {
        std::atomic<int> next{0};
        workers.each(num_parts, [&](int part) {
            for (int y = next.fetch_add(at_a_time); y < rows; y = next.fetch_add(at_a_time))
                work(part, y, std::min(rows, y + at_a_time));
        });
    }

    // Calls work(task, begin, end) on all rows of the reference, with what is the same for all of
    // them in `task`: the means to tell what is hidden too, where something can be, and it is
    // `asked` for. If these are a grid of cells, all of the depth is splat first.
    template <class Work>
    void each_row(RowsTask task, const DepthView& depth, bool asked, const Work& work) {
        const int height = rig.reference.height;
        std::unique_ptr<Scratch> scratch = take();
        DepthRows& rows = scratch->depth;
        rows.set(depth, rig.reference.width, height);
        for (DepthRows::Room& room : scratch->rooms) rows.prepare(room);
        if (occlusion && asked && row_grid.serves) task.row_grid = &row_grid;
        else if (occlusion && asked) {
            Nearness* cells = scratch->cells.data();
            const std::size_t size = cells_with_room(grid);
            workers.each(parts,
                         [&](int part) { std::fill_n(cells + part * size, size, Nearness{0}); });
            share_out(parts, height, kRows, [&](int part, int begin, int end) {
                splat_rows(projector, rows, scratch->rooms[part], grid, begin, end,
                           cells + part * size);
            });
            share_out(threads, grid.height, kRows, [&](int, int begin, int end) {
                join_cells(grid, cells, parts, begin, end, cells + parts * size);
            });
            task.cells = cells + parts * size;
        }
        task.projector = &projector;
        task.depth = &rows;
        task.grid = &grid;
        task.hide = options.occlusion == Occlusion::hide;
        const int at_a_time = task.row_grid ? row_grid.rows_at_a_time() : kRows;
        share_out(threads, height, at_a_time, [&](int part, int begin, int end) {
            RowsTask of_thread = task;
            of_thread.room = &scratch->rooms[part];
            of_thread.hidden = &scratch->hidden[part];
            work(of_thread, begin, end);
        });
        give_back(std::move(scratch));
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

DepthView checked(const ImageView& depth, double scale, const Pinhole& grid) {
    require_same_aspect("depth", depth.width, depth.height, grid.width, grid.height);
    const bool metres = depth.type == PixelType::f32;
    const bool units = depth.type == PixelType::u16 && scale > 0;
    if (depth.channels != 1 || !(metres || units))
        throw std::invalid_argument(
            "depth must be one float32 channel in metres, or uint16 with depth_scale given");
    return {depth, metres ? 1.0f : static_cast<float>(scale)};
}

}  // namespace

void Registrar::map(const ImageView& depth, float* out) const {
    const DepthView given = checked(depth, options().depth_scale, rig().reference);
    const bool asked = options().occlusion == Occlusion::hide;
    stream_->each_row({}, given, asked, [&](const RowsTask& task, int begin, int end) {
        map_rows(task, begin, end, out);
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
    RowsTask task{};
    task.source = source;
    task.nearest = options().nearest;
    task.registered = registered;
    task.mask = mask;
    const DepthView given = checked(depth, options().depth_scale, rig().reference);
    stream_->each_row(task, given, true, [&](const RowsTask& part, int begin, int end) {
        register_rows(part, begin, end);
    });
}

}  // namespace xcalib

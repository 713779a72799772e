// The registrar's inner loops, for whichever instruction set the machine has (Highway).
#pragma once

#include <cstdint>

#include "geometry/projector.hpp"
#include "images/depth_rows.hpp"
#include "register/cells.hpp"
#include "xcalib/image.hpp"

namespace xcalib {

// Raises the cells to the nearness of the points of rows [begin, end) that fall in them.
void splat_rows(const Projector& projector, const DepthRows& depth, DepthRows::Room& room,
                const CellGrid& grid, int begin, int end, Nearness* cells);

// Rows [begin, end) of the cells of all `count` parts as one: the nearest of each, and where both
// neighbours, left and right or above and below, are nearer, the farther of these: a surface whose
// pixels the source has farther apart leaves gaps.
void join_cells(const CellGrid& grid, const Nearness* parts, int count, int begin, int end,
                Nearness* out);

// What a thread has of its own to find what is hidden in a row (hidden_row-inl.hpp).
struct HiddenRoom {
    static constexpr int kRows = RowGrid::kMaxReach + 1;
    struct ToCells {
        float per_unit, shift;
    };
    // Of this row, and of those before it that shadows may fall from.
    int stride = 0;
    AlignedRow<float> place, inverse_z;           // by pixels
    AlignedRow<float> low, high, before, behind;  // by vectors
    AlignedRow<std::uint32_t> breaks, written;    // a bit for each vector
    AlignedRow<Nearness> cells;
    // By rows in turn: where what is kept of one stands, and the greatest 1/z.
    int slots[kRows] = {};
    float nearest[kRows] = {};
    ToCells to_cells[kRows] = {};
    bool any_written[kRows] = {};
    // Of this row alone.
    AlignedRow<float> across;  // by pixels
    AlignedRow<std::uint32_t> passed;

    void keep(int width, const RowGrid& grid);
};

// What all rows of a frame have in common. `cells` and `row_grid` are null where occlusion is not
// looked for.
struct RowsTask {
    const Projector* projector;
    const DepthRows* depth;
    DepthRows::Room* room;  // the thread's
    const CellGrid* grid;
    const Nearness* cells;
    const RowGrid* row_grid;  // null where the cells are, or nothing, looked at
    HiddenRoom* hidden;       // the thread's
    bool hide;                // occluded pixels are 0 in the image, and NaN in the map
    ImageView source;
    bool nearest;
    MutableImageView registered;
    std::uint8_t* mask;
};

void register_rows(const RowsTask& task, int begin, int end);

// The same places, as 2 floats a pixel; of the task, what is about the source is not looked at.
void map_rows(const RowsTask& task, int begin, int end, float* out);

}  // namespace xcalib

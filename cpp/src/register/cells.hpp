// Occlusion: the nearest surface that the source camera has in each cell of its image.
#pragma once

#include <cstdint>

#include "xcalib/camera.hpp"

namespace xcalib {

// The upper half of 1/z [1/m] as a float: rounded down to 1 in 128, so that no point hides itself.
// 0 where nothing is.
using Nearness = std::uint16_t;

// Cells as far apart as reference pixels are in the source: smaller ones would let a far surface
// look through a near one, larger ones would widen what is near.
struct CellGrid {
    int width = 0, height = 0;
    float per_pixel_x = 1, per_pixel_y = 1;
    // Hidden is what has a 1/z below that of its cell by more than
    // relative_tolerance / z + absolute_tolerance [1/m].
    float relative_tolerance = 0, absolute_tolerance = 0;
    // What is near hides half a cell to both sides, along the axis on which points move most.
    bool along_x = true;

    CellGrid() = default;
    explicit CellGrid(const Rig& rig);
    int count() const { return width * height; }
    int step() const { return along_x ? 1 : width; }  // to the next cell on that axis
};

// A buffer's length: behind the cells stands one for points that fall in none, and more that may be
// read together with the last ones.
inline std::size_t cells_with_room(const CellGrid& grid) {
    return static_cast<std::size_t>(grid.count()) + grid.width + 64;
}

// Cells along a row of the reference. Where epipolar lines run nearly along its rows, a pixel is
// hidden by others of its own row or, as good as always, not at all, and a row of cells does for
// what takes a grid of them elsewhere.
struct RowGrid {
    // A vector of cells written around a place must not leave the row.
    static constexpr int kBefore = 64, kBehind = 128;

    bool serves = false;             // is that so?
    bool along_u = true;             // along a row, u of the source changes; else v
    float per_pixel = 1, shift = 0;  // to cells, so that places grow along the row
    int count = 0;
    bool near_lies_back = true;  // near points lie where farther ones before them do

    RowGrid() = default;
    explicit RowGrid(const Rig& rig);
    int room() const { return count + kBehind; }
};

}  // namespace xcalib

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

// How far from the row of what hides to the row of what is hidden: so many rows for each 1/m that
// it is nearer, by bands of columns, and `reach` rows at most. Rows are counted as shadows fall:
// down, or else up.
struct Shadows {
    static constexpr int kBands = 16;
    bool down = true;
    float shortest[kBands] = {}, longest[kBands] = {};
    float longest_of_all = 0;
    int reach = 0;
};

// Cells along rows of the reference. Where epipolar lines run nearly along these, what hides a
// pixel is in its own row or in one of a few before, and a row of cells for each does for what
// takes a grid of them elsewhere.
struct RowGrid {
    // Cells before the first and behind the last: vectors around a place are read and written
    // whole.
    static constexpr int kBefore = 64, kBehind = 128;
    static constexpr int kMaxReach = 16;
    static constexpr int kBands = Shadows::kBands;  // of the image, by rows and by columns

    bool serves = false;             // is that so?
    bool along_u = true;             // along a row, u of the source changes; else v
    float per_pixel = 1, shift = 0;  // to cells, so that places grow along the row
    int count = 0;
    bool near_lies_back = true;  // near points lie where farther ones before them do

    RowGrid() = default;
    explicit RowGrid(const Rig& rig);
    int room() const { return count + kBehind; }
    // Rows are looked at so many at a time, whoever does it: shadows fall one way in these.
    int rows_at_a_time() const;
    Shadows shadows(int begin, int end) const;  // of these rows

   private:
    int height_ = 0;
    float farthest_ = 0;  // nothing is expected to be nearer [1/m]
    // How far down shadows fall where borders of bands meet. [rows per 1/m]
    float fall_[kBands + 1][kBands + 1] = {};
};

}  // namespace xcalib

// The caller's depth, of whatever size, as rows of the reference's grid: what `resize_depth` does,
// for kernels that take a row, use it while it is near, and keep no image of it.
#pragma once

#include <cstdint>
#include <vector>

#include "xcalib/export.hpp"
#include "xcalib/image.hpp"

namespace XCALIB_EXPORT xcalib {  // the library of calibration, another, has it from here

// Depth as the caller has it: float32 [m], or uint16 in units of `scale` metres.
struct DepthView {
    ImageView view;
    float scale = 1;
};

// Numbers that begin where a cache line does: whole vectors of them lie in one line.
template <class T>
class AlignedRow {
   public:
    void keep(int count) {  // room for as many
        const std::size_t lines = (count * sizeof(T) + sizeof(Line) - 1) / sizeof(Line);
        if (lines_.size() < lines) lines_.resize(lines);
    }
    int size() const { return static_cast<int>(lines_.size() * sizeof(Line) / sizeof(T)); }
    T* data() { return reinterpret_cast<T*>(lines_.data()); }
    const T* data() const { return reinterpret_cast<const T*>(lines_.data()); }

   private:
    struct alignas(64) Line {
        T numbers[64 / sizeof(T)];
    };
    std::vector<Line> lines_;
};

class DepthRows {
   public:
    // What a thread has of its own.
    class Room {
        friend class DepthRows;
        AlignedRow<float> row_;
        // By columns of the caller's depth: two of its rows in 1/m, the even and the odd one, and
        // what is between them, or, reducing, a Fold.
        AlignedRow<float> columns_[4];
        AlignedRow<std::uint64_t> smooth_;
        int held_[2] = {-1, -1};     // which rows these are
        int compared_ = -1;          // of which one and the next `smooth_` is
        std::vector<float> values_;  // of the pixels that one pixel is made of
    };

    // Both allocate only where a size is larger than any before. `depth` must outlive the rows;
    // rooms are prepared for each frame.
    void set(const DepthView& depth, int width, int height);
    void prepare(Room& room) const;

    const DepthView& given() const { return depth_; }
    int width() const { return width_; }
    int height() const { return height_; }
    // Are the rows other than the caller's?
    bool resizes() const { return width_ != depth_.view.width || height_ != depth_.view.height; }

    // Row y where it `resizes`, in metres, 0 where unknown; some pixels behind it may be read. It
    // lasts until the room serves the next one.
    const float* row(int y, Room& room) const;

    // Depths within this ratio of one another are taken for one surface.
    static constexpr float kSameSurface = 1.1f;
    // Some pixels behind a row are read and written with its last ones.
    static constexpr int kBehind = 128;
    // Of each column of the grid: growing, the caller's column left of it, and how far it is from
    // there; reducing, the first of the caller's columns and the one after the last.
    struct Columns {
        AlignedRow<std::int32_t> left, right;
        AlignedRow<float> part;
        int widest = 1;
    };
    // Two of the caller's rows in 1/m, the place of a row of the grid between them, and a bit for
    // each column: whether the four pixels from there on are of one surface.
    struct Pair {
        const float *upper, *lower;
        float part;
        const std::uint64_t* smooth;
    };
    // Of each of the caller's columns, in some rows: the nearest and the farthest that is known,
    // the sum [1/m] and the number.
    struct Fold {
        float *most, *least, *sum, *count;
    };

   private:
    bool reduces() const { return depth_.view.width > width_ && depth_.view.height > height_; }
    const float* inverse_row(int y, Room& room) const;
    const float* grown_row(int y, Room& room) const;

    DepthView depth_;
    int width_ = 0, height_ = 0;
    double step_x_ = 1, step_y_ = 1;  // the caller's pixels in one of the grid
    Columns columns_;
};

}  // namespace xcalib

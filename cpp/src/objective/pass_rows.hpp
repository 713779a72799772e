// What the passes over an image pair (nec_pass, edge_pair) work on: a row of derivatives, and edge
// pixels gathered until there are enough for their Gram matrix.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "geometry/projector.hpp"

namespace xcalib {

inline constexpr int kRoom = 64;  // past the end of a row: more than any vector holds

// The points of a row, and df/dX_S of what is derived there.
struct PointRow : SeenRow {
    std::vector<float> qx, qy, qz;

    explicit PointRow(int width)
        : SeenRow(width), qx(width + kRoom), qy(width + kRoom), qz(width + kRoom) {}
};

// Pixels in columns of [ds/dp ..., s, r]: s is the source's and r the reference's vector at a
// pixel, whose x and y components stand apart. Their Gram matrix is summed in float over a tile,
// which fits into the nearest cache, and in double over all tiles.
struct PassTile {
    static constexpr int kPixels = 256;

    int count;    // parameters
    int columns;  // a multiple of 4: those past count + 2 stay zero
    int capacity = kPixels + kRoom;
    int filled = 0;
    std::vector<float> x, y;
    std::vector<double> sums;           // columns^2, lower triangle
    Eigen::MatrixXd* pixels = nullptr;  // receives the columns too, two rows a pixel

    explicit PassTile(int parameters)
        : count(parameters), columns((parameters + 2 + 3) / 4 * 4), x(columns * capacity),
          y(columns * capacity), sums(columns * columns) {}

    // (count + 2)^2, symmetric.
    Eigen::MatrixXd gram() const {
        const Eigen::Map<const Eigen::Matrix<double, -1, -1, Eigen::RowMajor>> all(
            sums.data(), columns, columns);
        return all.topLeftCorner(count + 2, count + 2).selfadjointView<Eigen::Lower>();
    }
};

}  // namespace xcalib

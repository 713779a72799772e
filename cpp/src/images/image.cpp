#include "xcalib/image.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <sstream>
#include <stdexcept>

namespace xcalib {
namespace {

bool known(float depth) { return depth > 0.0f && std::isfinite(depth); }

// Depths within this ratio of one another are taken for one surface.
constexpr float kSameSurface = 1.1f;

// `values` is room that serves all pixels in turn.
float reduced_depth(const Image& depth, double x0, double x1, double y0, double y1,
                    std::vector<float>& values) {
    const int left = static_cast<int>(std::floor(x0 + 0.5));
    const int right = std::max(left + 1, static_cast<int>(std::floor(x1 + 0.5)));
    const int top = static_cast<int>(std::floor(y0 + 0.5));
    const int bottom = std::max(top + 1, static_cast<int>(std::floor(y1 + 0.5)));
    const int end_x = std::min(right, depth.width), end_y = std::min(bottom, depth.height);
    const int cells = (end_x - left) * (end_y - top);
    float nearest = std::numeric_limits<float>::max(), farthest = 0.0f;
    double sum = 0;  // of the known pixels' inverse depths
    int known_cells = 0;
    for (int y = top; y < end_y; ++y) {
        const float* row = depth.row(y);
        for (int x = left; x < end_x; ++x) {
            const bool is_known = row[x] > 0;
            nearest = std::min(nearest, is_known ? row[x] : nearest);
            farthest = std::max(farthest, row[x]);
            sum += is_known ? 1.0 / row[x] : 0.0;
            known_cells += is_known;
        }
    }
    if (known_cells == 0 || 2 * known_cells < cells) return 0.0f;
    // Nearly everywhere they are of one surface, whichever of them is the median.
    if (farthest < nearest * kSameSurface) return static_cast<float>(known_cells / sum);
    values.clear();
    for (int y = top; y < end_y; ++y)
        for (int x = left; x < end_x; ++x)
            if (const float d = depth.row(y)[x]; d > 0) values.push_back(d);
    const std::size_t count = values.size();
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(count / 2);
    std::nth_element(values.begin(), middle, values.end());
    const float median = *middle;
    double inverse = 0;
    int members = 0;
    for (const float value : values)
        if (value < median * kSameSurface && value * kSameSurface > median) {
            inverse += 1.0 / value;
            ++members;
        }
    return static_cast<float>(members / inverse);
}

float interpolated_depth(const Image& depth, double x, double y) {
    const int nx = std::clamp(static_cast<int>(std::lround(x)), 0, depth.width - 1);
    const int ny = std::clamp(static_cast<int>(std::lround(y)), 0, depth.height - 1);
    const float nearest = depth.row(ny)[nx];
    if (nearest <= 0) return 0.0f;
    const int x0 = std::clamp(static_cast<int>(std::floor(x)), 0, depth.width - 1);
    const int y0 = std::clamp(static_cast<int>(std::floor(y)), 0, depth.height - 1);
    const int x1 = std::min(x0 + 1, depth.width - 1), y1 = std::min(y0 + 1, depth.height - 1);
    const float d[4] = {depth.row(y0)[x0], depth.row(y0)[x1], depth.row(y1)[x0], depth.row(y1)[x1]};
    for (float value : d)
        if (value <= 0 || value > nearest * kSameSurface || value * kSameSurface < nearest)
            return nearest;
    const double ax = std::clamp(x - x0, 0.0, 1.0), ay = std::clamp(y - y0, 0.0, 1.0);
    const double inverse =
        (1 - ay) * ((1 - ax) / d[0] + ax / d[1]) + ay * ((1 - ax) / d[2] + ax / d[3]);
    return static_cast<float>(1.0 / inverse);
}

}  // namespace

std::size_t bytes_per_channel(PixelType type) {
    switch (type) {
        case PixelType::u8: return 1;
        case PixelType::u16: return 2;
        case PixelType::f32: return 4;
    }
    throw std::invalid_argument("unknown pixel type");
}

Image clean_depth(const ImageView& depth) {
    if (depth.type != PixelType::f32 || depth.channels != 1)
        throw std::invalid_argument("depth must be one float32 channel in metres");
    Image out(depth.width, depth.height);
    for (int y = 0; y < depth.height; ++y) {
        const float* in = depth.row<float>(y);
        for (int x = 0; x < depth.width; ++x) out.row(y)[x] = known(in[x]) ? in[x] : 0.0f;
    }
    return out;
}

Image resize_depth(const Image& depth, int width, int height) {
    if (width == depth.width && height == depth.height) return depth;
    const double sx = static_cast<double>(depth.width) / width;
    const double sy = static_cast<double>(depth.height) / height;
    const bool reduces = sx > 1 && sy > 1;
    Image out(width, height);
    std::vector<float> room;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            out.row(y)[x] =
                reduces ? reduced_depth(depth, x * sx, (x + 1) * sx, y * sy, (y + 1) * sy, room)
                        : interpolated_depth(depth, (x + 0.5) * sx - 0.5, (y + 0.5) * sy - 0.5);
    return out;
}

void require_same_aspect(const char* name, int width, int height, int expected_width,
                         int expected_height) {
    const long difference = std::labs(static_cast<long>(width) * expected_height -
                                      static_cast<long>(height) * expected_width);
    if (width > 0 && height > 0 &&
        difference <= std::max({width, height, expected_width, expected_height}))
        return;
    std::ostringstream message;
    message << name << " is " << width << "x" << height << ", expected the aspect of "
            << expected_width << "x" << expected_height;
    throw std::invalid_argument(message.str());
}

}  // namespace xcalib

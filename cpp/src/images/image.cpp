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

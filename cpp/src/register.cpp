#include "xcalib/register.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <sstream>
#include <stdexcept>

#include "parallel.hpp"

namespace xcalib {
namespace {

template <class T>
T rounded(float value) {
    if constexpr (std::is_floating_point_v<T>) return value;
    else return static_cast<T>(value + 0.5f);  // a mean of values in range is in range
}

// One row of type T, zero where not valid: the bilinear mean, or the pixel whose centre is next, as
// it is, so that counts of a radiometric source are never mixed.
template <class T, int kChannels, bool kNearest>
void sample_row(const ImageView& source, const float* u, const float* v,
                const std::uint8_t* validity, int width, void* row) {
    T* out = static_cast<T*>(row);
    for (int x = 0; x < width; ++x, out += kChannels) {
        if (validity[x] != static_cast<std::uint8_t>(Validity::valid)) {
            for (int c = 0; c < kChannels; ++c) out[c] = T{0};
            continue;
        }
        if constexpr (kNearest) {
            const T* pixel = source.row<T>(static_cast<int>(v[x] + 0.5f)) +
                             kChannels * static_cast<int>(u[x] + 0.5f);
            for (int c = 0; c < kChannels; ++c) out[c] = pixel[c];
            continue;
        }
        // The last cell serves its far edge too, so that all four pixels exist.
        const int x0 = std::min(static_cast<int>(u[x]), source.width - 2);
        const int y0 = std::min(static_cast<int>(v[x]), source.height - 2);
        const float a = u[x] - static_cast<float>(x0), b = v[x] - static_cast<float>(y0);
        const T* top = source.row<T>(y0) + kChannels * x0;
        const T* bottom = source.row<T>(y0 + 1) + kChannels * x0;
        for (int c = 0; c < kChannels; ++c) {
            const float upper =
                static_cast<float>(top[c]) +
                a * (static_cast<float>(top[c + kChannels]) - static_cast<float>(top[c]));
            const float lower =
                static_cast<float>(bottom[c]) +
                a * (static_cast<float>(bottom[c + kChannels]) - static_cast<float>(bottom[c]));
            out[c] = rounded<T>(upper + b * (lower - upper));
        }
    }
}

using RowSampler = void (*)(const ImageView&, const float*, const float*, const std::uint8_t*, int,
                            void*);

template <class T>
RowSampler row_sampler(int channels, bool nearest) {
    if (channels == 3) return nearest ? sample_row<T, 3, true> : sample_row<T, 3, false>;
    return nearest ? sample_row<T, 1, true> : sample_row<T, 1, false>;
}

RowSampler row_sampler(PixelType type, int channels, bool nearest) {
    switch (type) {
        case PixelType::u8: return row_sampler<std::uint8_t>(channels, nearest);
        case PixelType::u16: return row_sampler<std::uint16_t>(channels, nearest);
        case PixelType::f32: return row_sampler<float>(channels, nearest);
    }
    throw std::invalid_argument("unknown pixel type");
}

void require_size(const char* name, int width, int height, const Pinhole& camera) {
    if (width == camera.width && height == camera.height) return;
    std::ostringstream message;
    message << name << " is " << width << "x" << height << ", expected the rig's " << camera.width
            << "x" << camera.height;
    throw std::invalid_argument(message.str());
}

}  // namespace

Registrar::Registrar(const Rig& rig, int num_threads, bool nearest)
    : rig_((rig.validate(), rig)), reprojection_(rig), num_threads_(num_threads),
      nearest_(nearest) {
    if (num_threads < 0)
        throw std::invalid_argument("num_threads is " + std::to_string(num_threads) +
                                    ", expected 0 (every core) or more");
    if (rig.source.width < 2 || rig.source.height < 2)
        throw std::invalid_argument("source is narrower than 2 px, too small to interpolate");
}

ImageView Registrar::on_reference_grid(const ImageView& depth, Image& room) const {
    const Pinhole& grid = rig_.reference;
    require_same_aspect("depth", depth.width, depth.height, grid.width, grid.height);
    if (depth.type != PixelType::f32 || depth.channels != 1)
        throw std::invalid_argument("depth must be one float32 channel in metres");
    if (depth.width == grid.width && depth.height == grid.height) return depth;
    room = resize_depth(clean_depth(depth), grid.width, grid.height);
    return room.view();
}

void Registrar::map(const ImageView& depth, float* out) const {
    Image room;
    const ImageView grid = on_reference_grid(depth, room);
    parallel_ranges(grid.height, num_threads_, [&](int begin, int end) {
        std::vector<float> u(grid.width), v(grid.width);
        std::vector<std::uint8_t> validity(grid.width);
        for (int y = begin; y < end; ++y) {
            map_row(reprojection_, grid.row<float>(y), y, grid.width, u.data(), v.data(),
                    validity.data());
            float* row = out + 2 * static_cast<std::size_t>(y) * grid.width;
            for (int x = 0; x < grid.width; ++x) {
                row[2 * x] = u[x];
                row[2 * x + 1] = v[x];
            }
        }
    });
}

void Registrar::register_frame(const ImageView& source, const ImageView& depth,
                               const MutableImageView& registered, std::uint8_t* mask) const {
    require_size("source", source.width, source.height, rig_.source);
    require_size("registered", registered.width, registered.height, rig_.reference);
    if (registered.type != source.type || registered.channels != source.channels)
        throw std::invalid_argument("registered must have the source's pixel type and channels");
    Image room;
    const ImageView grid = on_reference_grid(depth, room);
    const RowSampler sample = row_sampler(source.type, source.channels, nearest_);
    parallel_ranges(grid.height, num_threads_, [&](int begin, int end) {
        std::vector<float> u(grid.width), v(grid.width);
        for (int y = begin; y < end; ++y) {
            std::uint8_t* validity = mask + static_cast<std::size_t>(y) * grid.width;
            map_row(reprojection_, grid.row<float>(y), y, grid.width, u.data(), v.data(), validity);
            sample(source, u.data(), v.data(), validity, grid.width,
                   static_cast<char*>(registered.data) + y * registered.row_bytes);
        }
    });
}

}  // namespace xcalib

#include "xcalib/judge/overlay.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "base/format.hpp"
#include "base/median.hpp"
#include "xcalib/gray.hpp"

namespace xcalib {
namespace {

// As to_gray; what is not finite is 0, since a picture must not fail on a dead pixel.
Image gray_for_the_eye(const ImageView& image) {
    if (image.type != PixelType::f32) return to_gray(image);
    const int columns = image.width * image.channels;
    std::vector<float> finite;
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < columns; ++x) {
            const float value = image.row<float>(y)[x];
            finite.push_back(std::isfinite(value) ? value : 0.0f);
        }
    ImageView view = image;
    view.data = finite.data();
    view.row_bytes = static_cast<std::ptrdiff_t>(columns * sizeof(float));
    return to_gray(view);
}

}  // namespace

std::vector<std::uint8_t> display_gray(const ImageView& image) {
    const Image gray = gray_for_the_eye(image);
    std::vector<float> used;
    for (const float value : gray.pixels)
        if (value != 0) used.push_back(value);
    const double low = used.empty() ? 0.0 : quantile(used, 0.01);
    const double high = used.empty() ? 1.0 : quantile(used, 0.99);
    const double scale = 255 / std::max(high - low, 1e-6);
    std::vector<std::uint8_t> out;
    out.reserve(gray.pixels.size());
    for (const float value : gray.pixels)
        out.push_back(static_cast<std::uint8_t>(std::clamp((value - low) * scale, 0.0, 255.0)));
    return out;
}

std::vector<std::uint8_t> overlay(const ImageView& reference, const ImageView& registered,
                                  const std::uint8_t* valid) {
    if (reference.width != registered.width || reference.height != registered.height)
        throw std::invalid_argument(format("registered is %dx%d, expected the reference's %dx%d",
                                           registered.width, registered.height, reference.width,
                                           reference.height));
    const std::vector<std::uint8_t> red = display_gray(reference), cyan = display_gray(registered);
    std::vector<std::uint8_t> out;
    out.reserve(3 * red.size());
    for (std::size_t i = 0; i < red.size(); ++i) {
        const std::uint8_t other = valid && !valid[i] ? red[i] : cyan[i];
        out.insert(out.end(), {other, other, red[i]});
    }
    return out;
}

}  // namespace xcalib

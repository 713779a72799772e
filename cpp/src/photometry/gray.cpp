#include "xcalib/gray.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "photometry/mat.hpp"

namespace xcalib {
namespace {

template <class T>
void gray_rows(const ImageView& image, float scale, Image& gray) {
    for (int y = 0; y < image.height; ++y) {
        const T* in = image.row<T>(y);
        float* out = gray.row(y);
        if (image.channels == 1) {
            for (int x = 0; x < image.width; ++x) out[x] = scale * static_cast<float>(in[x]);
        } else {  // ITU-R BT.601 luma
            for (int x = 0; x < image.width; ++x)
                out[x] = scale * (0.114f * static_cast<float>(in[3 * x]) +
                                  0.587f * static_cast<float>(in[3 * x + 1]) +
                                  0.299f * static_cast<float>(in[3 * x + 2]));
        }
    }
}

// Percentiles of a sample of about 20 000 pixels, which is enough and costs little.
class Percentiles {
   public:
    explicit Percentiles(const Image& image) {
        const std::size_t step = std::max<std::size_t>(1, image.pixels.size() / 20000);
        sample_.reserve(image.pixels.size() / step + 1);
        for (std::size_t i = 0; i < image.pixels.size(); i += step)
            sample_.push_back(image.pixels[i]);
    }
    // The value with `share` of the others below it, [0, 1].
    float at(double share) {
        const double place = share * static_cast<double>(sample_.size() - 1);
        const auto value = sample_.begin() + std::lround(place);
        std::nth_element(sample_.begin(), value, sample_.end());
        return *value;
    }

   private:
    std::vector<float> sample_;
};

}  // namespace

namespace {

Image as_gray(const ImageView& image) {
    if (image.channels != 1 && image.channels != 3)
        throw std::invalid_argument("image has " + std::to_string(image.channels) +
                                    " channels, expected 1 or 3");
    Image gray(image.width, image.height);
    switch (image.type) {
        case PixelType::u8: gray_rows<std::uint8_t>(image, 1.0f / 255, gray); break;
        case PixelType::u16: gray_rows<std::uint16_t>(image, 1.0f / 65535, gray); break;
        case PixelType::f32: gray_rows<float>(image, 1.0f, gray); break;
    }
    return gray;
}

// Layer by layer from what is known, each pixel the mean of its neighbours in the layers before.
void fill_unknown(Image& image) {
    const int width = image.width, height = image.height;
    std::vector<std::uint8_t> state(image.pixels.size());  // 0 unknown, 1 known, 2 in the layer
    const auto around = [&](int at, const auto& work) {
        const int x = at % width, y = at / width;
        for (int v = std::max(0, y - 1); v <= std::min(height - 1, y + 1); ++v)
            for (int u = std::max(0, x - 1); u <= std::min(width - 1, x + 1); ++u)
                work(v * width + u);
    };
    for (std::size_t i = 0; i < state.size(); ++i) state[i] = std::isfinite(image.pixels[i]);
    std::vector<int> layer, next;
    const auto reach = [&](int at) {
        around(at, [&](int i) {
            if (state[static_cast<std::size_t>(i)] != 0) return;
            state[static_cast<std::size_t>(i)] = 2;
            next.push_back(i);
        });
    };
    for (int i = 0; i < width * height; ++i)
        if (state[static_cast<std::size_t>(i)] == 1) reach(i);
    while (!next.empty()) {
        layer.swap(next);
        next.clear();
        for (const int at : layer) {
            float sum = 0;
            int count = 0;
            around(at, [&](int i) {
                if (state[static_cast<std::size_t>(i)] != 1) return;
                sum += image.pixels[static_cast<std::size_t>(i)];
                ++count;
            });
            image.pixels[static_cast<std::size_t>(at)] = sum / static_cast<float>(count);
        }
        for (const int at : layer) state[static_cast<std::size_t>(at)] = 1;
        for (const int at : layer) reach(at);
    }
}

}  // namespace

Image to_gray(const ImageView& image) {
    Image gray = as_gray(image);
    if (image.type != PixelType::f32) return gray;
    for (std::size_t i = 0; i < gray.pixels.size(); ++i)
        if (!std::isfinite(gray.pixels[i])) {
            std::ostringstream message;
            message << "image has the value " << gray.pixels[i] << " at x = " << i % image.width
                    << ", y = " << i / image.width << ", expected finite pixels";
            throw std::invalid_argument(message.str());
        }
    return gray;
}

Image known_gray(const ImageView& image) {
    Image gray = as_gray(image);
    if (image.type != PixelType::f32) return gray;
    const auto unknown = std::count_if(gray.pixels.begin(), gray.pixels.end(),
                                       [](float value) { return !std::isfinite(value); });
    if (2 * static_cast<std::size_t>(unknown) > gray.pixels.size())
        throw std::invalid_argument("image has " + std::to_string(unknown) + " of " +
                                    std::to_string(gray.pixels.size()) +
                                    " pixels that are not finite, expected at most half of them");
    if (unknown) fill_unknown(gray);
    return gray;
}

Image resize_area(const Image& image, int width, int height) {
    if (width == image.width && height == image.height) return image;
    Image out(width, height);
    const bool reduces = width <= image.width && height <= image.height;
    cv::Mat result = as_mat(out);
    cv::resize(as_mat(image), result, result.size(), 0, 0,
               reduces ? cv::INTER_AREA : cv::INTER_LINEAR);
    return out;
}

Image gaussian_blur(const Image& image, double sigma_px) {
    if (sigma_px <= 0) return image;
    Image out(image.width, image.height);
    cv::Mat result = as_mat(out);
    cv::GaussianBlur(as_mat(image), result, cv::Size(), sigma_px, sigma_px, cv::BORDER_REPLICATE);
    return out;
}

Image normalize_percentiles(const Image& image) {
    Percentiles percentiles(image);
    float low = percentiles.at(0.01), high = percentiles.at(0.99);
    if (!(high > low)) {  // nearly all pixels equal: take what there is
        const auto [min, max] = std::minmax_element(image.pixels.begin(), image.pixels.end());
        low = *min;
        high = *max;
    }
    if (!(high > low)) {
        std::ostringstream message;
        message << "image is constant (every pixel is " << low << "), expected edges";
        throw std::invalid_argument(message.str());
    }
    Image out = image;
    for (float& value : out.pixels) value = std::clamp((value - low) / (high - low), 0.0f, 1.0f);
    return out;
}

Image normalize_dark(const Image& image) {
    constexpr float kMedian = 0.4f;
    constexpr float kStrongest = 100.0f;
    Image out = normalize_percentiles(image);
    const float median = Percentiles(out).at(0.5);
    if (median >= kMedian) return out;
    float low = 0.0f, high = kStrongest;
    for (int i = 0; i < 30; ++i) {
        const float k = 0.5f * (low + high);
        (std::log1p(k * median) < kMedian * std::log1p(k) ? low : high) = k;
    }
    const float k = high, scale = 1.0f / std::log1p(k);
    for (float& value : out.pixels) value = scale * std::log1p(k * value);
    return out;
}

}  // namespace xcalib

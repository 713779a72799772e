#include "xcalib/footage/joined.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "base/format.hpp"
#include "base/median.hpp"
#include "photometry/mat.hpp"
#include "xcalib/gray.hpp"

namespace xcalib {
namespace {

// A seam differs so many times more than rows beside each other do in either half.
constexpr double kSeam = 3.0;

// Of half a frame, its longer side to the shorter: 4:3 and 5:4.
bool is_camera_like(double ratio) { return ratio > 1.2 && ratio < 1.4; }

// Mean difference of each row to the one after it.
std::vector<double> steps_of(const Image& image) {
    std::vector<double> steps;
    for (int y = 0; y + 1 < image.height; ++y) {
        double sum = 0;
        for (int x = 0; x < image.width; ++x)
            sum += std::abs(image.row(y + 1)[x] - image.row(y)[x]);
        steps.push_back(sum / image.width);
    }
    return steps;
}

bool has_seam(const Image& image) {
    if (image.height % 2 || image.height < 16) return false;
    const std::vector<double> steps = steps_of(image);
    const auto middle = steps.begin() + image.height / 2 - 1;
    const double above = median(std::vector<double>(steps.begin(), middle));
    const double below = median(std::vector<double>(middle + 1, steps.end()));
    return *middle > kSeam * std::min(above, below) &&
           *middle > 0.9 * *std::max_element(steps.begin(), middle);
}

Image turned(const Image& image) {
    Image out(image.height, image.width);
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) out.row(x)[y] = image.row(y)[x];
    return out;
}

}  // namespace

std::pair<std::string, std::string> joined_images(const std::vector<ImageView>& images,
                                                  const std::string& name) {
    if (images.empty()) return {};
    const double width = images[0].width, height = images[0].height;
    const bool above = is_camera_like(width / (height / 2));
    const bool beside = is_camera_like(width / 2 / height);
    if (!above && !beside) return {};
    std::size_t seams = 0;
    for (const ImageView& view : images) {
        const Image gray = known_gray(view);
        seams += has_seam(above ? gray : turned(gray));
    }
    if (4 * seams < 3 * images.size()) return {};
    return {format("%s's frames, %dx%d, look like two images %s", name.c_str(), images[0].width,
                   images[0].height, above ? "one above the other" : "side by side"),
            format("expected %s#%s or %s#%s", name.c_str(), above ? "top" : "left", name.c_str(),
                   above ? "bottom" : "right")};
}

}  // namespace xcalib

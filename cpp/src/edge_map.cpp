#include "xcalib/edge_map.hpp"

#include <algorithm>
#include <cmath>

#include "mat.hpp"
#include "xcalib/gray.hpp"

namespace xcalib {
namespace {

constexpr double kBlur = 0.8;          // before edges are found, and of what is sampled [px]
constexpr double kSurroundings = 1.5;  // [px] of the reduced map

EdgeMap sized(int width, int height) {
    EdgeMap map{width, height, {}};
    map.z.resize(static_cast<std::size_t>(width) * height);
    return map;
}

cv::Mat as_mat(const EdgeMap& map) {
    return {map.height, map.width, CV_32FC2, const_cast<std::complex<float>*>(map.z.data())};
}

}  // namespace

EdgeMap edge_map(const Image& image, float floor) {
    const Image smooth = gaussian_blur(image, kBlur);
    const EdgeField field = edge_field(smooth, mean_gradient(smooth, nullptr), floor);
    EdgeMap full = sized(image.width, image.height);
    for (std::size_t i = 0; i < full.z.size(); ++i) {
        const float x = field.x[i], y = field.y[i];
        const float a = std::sqrt(x * x + y * y);
        if (a > 0) full.z[i] = {(x * x - y * y) / a, 2 * x * y / a};
    }
    int halvings = 0;
    while (image.width >> halvings > kEdgeMapWidth) ++halvings;
    if (halvings == 0) return full;
    EdgeMap out = sized(image.width >> halvings, image.height >> halvings);
    cv::resize(as_mat(full), as_mat(out), as_mat(out).size(), 0, 0, cv::INTER_AREA);
    return out;
}

EdgeMap reduced(const EdgeMap& edges, int width, int height) {
    EdgeMap out = sized(std::min(width, edges.width), std::min(height, edges.height));
    cv::Mat small;
    cv::resize(as_mat(edges), small, as_mat(out).size(), 0, 0, cv::INTER_AREA);
    small = blurred(small, kBlur);
    cv::subtract(small, blurred(small, kSurroundings), as_mat(out));
    return out;
}

}  // namespace xcalib

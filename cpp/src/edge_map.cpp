#include "xcalib/edge_map.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "xcalib/nec.hpp"

namespace xcalib {
namespace {

constexpr double kBlur = 0.8;          // before edges are found, and of what is sampled [px]
constexpr double kSurroundings = 1.5;  // [px] of the reduced map

cv::Mat blurred(const cv::Mat& map, double sigma) {
    cv::Mat out;
    cv::GaussianBlur(map, out, cv::Size(), sigma, sigma, cv::BORDER_REFLECT_101);
    return out;
}

EdgeMap sized(int width, int height) {
    EdgeMap map{width, height, {}};
    map.z.resize(static_cast<std::size_t>(width) * height);
    return map;
}

cv::Mat view(const EdgeMap& map) {
    return {map.height, map.width, CV_32FC2, const_cast<std::complex<float>*>(map.z.data())};
}

}  // namespace

EdgeMap edge_map(const Image& image) {
    const Image smooth = gaussian_blur(image, kBlur);
    const EdgeField field = edge_field(smooth, mean_gradient(smooth, nullptr));
    EdgeMap full{image.width, image.height, {}};
    full.z.resize(field.x.size());
    for (std::size_t i = 0; i < full.z.size(); ++i) {
        const float x = field.x[i], y = field.y[i];
        const float a = std::sqrt(x * x + y * y);
        if (a > 0) full.z[i] = {(x * x - y * y) / a, 2 * x * y / a};
    }
    int halvings = 0;
    while (image.width >> halvings > kEdgeMapWidth) ++halvings;
    if (halvings == 0) return full;
    EdgeMap out = sized(image.width >> halvings, image.height >> halvings);
    cv::resize(view(full), view(out), view(out).size(), 0, 0, cv::INTER_AREA);
    return out;
}

EdgeMap reduced(const EdgeMap& edges, int width, int height) {
    EdgeMap out = sized(std::min(width, edges.width), std::min(height, edges.height));
    cv::Mat small;
    cv::resize(view(edges), small, view(out).size(), 0, 0, cv::INTER_AREA);
    small = blurred(small, kBlur);
    cv::subtract(small, blurred(small, kSurroundings), view(out));
    return out;
}

}  // namespace xcalib

#include "xcalib/edge_map.hpp"

#include <algorithm>
#include <cmath>

#include "objective/gradient_rows.hpp"
#include "photometry/mat.hpp"
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
    const EdgeField field = edge_field(smooth, mean_gradient(smooth), floor);
    EdgeMap full = sized(image.width, image.height);
    for (int y = 0; y < image.height; ++y) {
        const std::size_t offset = static_cast<std::size_t>(y) * image.width;
        doubled_angles(field.x.data() + offset, field.y.data() + offset, image.width,
                       full.z.data() + offset);
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

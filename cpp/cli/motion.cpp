#include "motion.hpp"

#include <opencv2/core.hpp>
#include <opencv2/video/tracking.hpp>

namespace xcalib::cli {

Motion motion_between(const ImageView& from, const ImageView& to) {
    const auto mat = [](const ImageView& view) {
        return cv::Mat(view.height, view.width, CV_8UC1, const_cast<void*>(view.data),
                       static_cast<std::size_t>(view.row_bytes));
    };
    // As python/xcalib/motion.py has it: refined at full size, since edges count here.
    const cv::Ptr<cv::DISOpticalFlow> flow =
        cv::DISOpticalFlow::create(cv::DISOpticalFlow::PRESET_MEDIUM);
    flow->setFinestScale(0);
    flow->setVariationalRefinementIterations(15);
    cv::Mat both;
    flow->calc(mat(from), mat(to), both);
    Motion motion{Image(from.width, from.height), Image(from.width, from.height)};
    for (int row = 0; row < from.height; ++row)
        for (int column = 0; column < from.width; ++column) {
            const auto& moved = both.at<cv::Vec2f>(row, column);
            motion.x.row(row)[column] = moved[0];
            motion.y.row(row)[column] = moved[1];
        }
    return motion;
}

}  // namespace xcalib::cli

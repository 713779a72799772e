// Two cameras that are one: whatever the scene, the rig to be found is the identity. Goes through
// the solver and a rig file and back.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <xcalib/calibrate.hpp>
#include <xcalib/rig_file.hpp>

int main() {
    std::mt19937 random(1);
    std::vector<xcalib::Image> images, depths;
    for (int i = 0; i < 4; ++i) {
        xcalib::Image image(160, 120), depth(160, 120);
        for (int board = 0; board < 40; ++board) {
            const int left = random() % 150, top = random() % 110;
            const int right = std::min<int>(160, left + 5 + random() % 40);
            const int bottom = std::min<int>(120, top + 5 + random() % 30);
            const float value = 0.1f + random() % 90 / 100.0f;
            for (int y = top; y < bottom; ++y)
                for (int x = left; x < right; ++x) image.row(y)[x] = value;
        }
        for (int y = 0; y < 120; ++y)
            for (int x = 0; x < 160; ++x) depth.row(y)[x] = 4.0f + 0.05f * y + i;
        images.push_back(image);
        depths.push_back(depth);
    }
    std::vector<xcalib::ImageView> image_views, depth_views;
    for (const xcalib::Image& image : images) image_views.push_back(image.view());
    for (const xcalib::Image& depth : depths) depth_views.push_back(depth.view());
    const xcalib::Pinhole camera = xcalib::Pinhole::from_hfov(160, 120, 0.8);
    const xcalib::CalibrationResult result =
        xcalib::calibrate(image_views, image_views, depth_views, xcalib::Rig{camera, camera, {}});
    xcalib::save_rig(result.rig, "rig.yaml");
    const xcalib::Rig rig = xcalib::load_rig("rig.yaml");
    std::printf("source fx %.3f of %.3f px, |t| = %.4f m\n", rig.source.fx, camera.fx,
                rig.t().norm());
    return std::abs(rig.source.fx - camera.fx) < 1 && rig.t().norm() < 0.02 ? EXIT_SUCCESS
                                                                            : EXIT_FAILURE;
}

// Working images of a rig that is known: what the solvers are tested on.
#pragma once

#include <cmath>
#include <vector>

#include "scenes.hpp"
#include "solve/working_images.hpp"
#include "xcalib/gray.hpp"

namespace xcalib::testing {

inline constexpr int kWidth = 200, kHeight = 150;

struct Scene {
    Rig truth;
    WorkingImages images;
    std::vector<Image> depths;
};

// The finest level of all pairs.
inline Level finest(const Scene& scene) { return make_level(scene.images, 1, scene.truth, 2); }

// Three pairs of a rig with the source's contrast reversed, depth exact: `count` blobs, `sigma` px
// wide.
inline Scene make_scene(unsigned seed, int count = 60, double sigma = 4) {
    std::mt19937 random(seed);
    Scene scene;
    scene.truth = random_rig(random, kWidth, kHeight, 180, 144);
    scene.truth.source.fx = 0.95 * scene.truth.reference.fx * 180 / kWidth;
    scene.truth.source.fy = 1.01 * scene.truth.source.fx;
    for (int i = 0; i < 3; ++i) {
        const Field texture = blobs(random, kWidth, kHeight, count, sigma, 0.9);
        const Field base = rolling_depth(kWidth, kHeight);
        const Field depth = [base, i](double x, double y) {
            return base(x + 40 * i, y - 20 * i) * (1 + 0.3 * i);
        };
        scene.images.references.push_back(drawn(texture, kWidth, kHeight));
        scene.images.sources.push_back(source_view(
            scene.truth, [&](double x, double y) { return 1 - texture(x, y); }, depth));
        scene.depths.push_back(drawn(depth, kWidth, kHeight));
        scene.images.reference_edges.push_back(edge_map(scene.images.references[i]));
        scene.images.source_edges.push_back(edge_map(scene.images.sources[i]));
        for (int factor : kFactors) {
            const int width = static_cast<int>(std::lround(kWidth / double(factor)));
            const int height = static_cast<int>(std::lround(kHeight / double(factor)));
            ReducedImages& reduced = scene.images.pyramid[factor];
            reduced.references.push_back(resize_area(scene.images.references[i], width, height));
            reduced.depths.push_back(resize_depth(scene.depths[i], width, height));
            if (factor >= kCoarse)
                reduced.edges.push_back(
                    xcalib::reduced(scene.images.reference_edges[i], width, height));
        }
    }
    return scene;
}

// Some pixels off, in every parameter that stage 2 has.
inline Rig perturbed(const Rig& truth) {
    Rig rig = turned(truth, {0.006, -0.008, 0.006});
    rig.source_from_reference.translation += Eigen::Vector3d(0.04, -0.03, 0.03);
    rig.source.fx *= 1.01;
    rig.source.fy *= 1.006;
    rig.source.cx += 0.7;
    rig.source.cy -= 0.5;
    rig.source.skew += 0.4;
    return rig;
}

// How far the rig puts pixels from their true place [px of the source]: mean over what both see.
inline double end_point_error(const Scene& scene, const Rig& rig) {
    double sum = 0;
    int count = 0;
    for (const Image& depth : scene.depths)
        for (int y = 0; y < depth.height; ++y)
            for (int x = 0; x < depth.width; ++x) {
                const double z = depth.row(y)[x];
                const Eigen::Vector2d truth = mapped(scene.truth, x, y, z);
                if (truth.x() < 0 || truth.x() > rig.source.width - 1 || truth.y() < 0 ||
                    truth.y() > rig.source.height - 1)
                    continue;
                sum += (mapped(rig, x, y, z) - truth).norm();
                ++count;
            }
    return sum / count;
}

}  // namespace xcalib::testing

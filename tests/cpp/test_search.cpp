#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "scenes.hpp"
#include "xcalib/search.hpp"

namespace xcalib {
namespace {

using namespace ::xcalib::testing;  // NOLINT: scenes.hpp

constexpr double kDegree = 3.14159265358979323846 / 180;

// Overlapping rectangles of random gray: edges of every length, as in a street.
struct Town {
    struct Box {
        double x0, y0, x1, y1, gray;
    };
    std::vector<Box> boxes;

    Town(std::mt19937& random, double reach, int count) {
        for (int i = 0; i < count; ++i) {
            const double x = uniform(random, -reach, reach), y = uniform(random, -reach, reach);
            const double w = uniform(random, 0.03, 0.3), h = uniform(random, 0.03, 0.3);
            boxes.push_back({x - w, y - h, x + w, y + h, uniform(random, 0, 1)});
        }
    }
    double at(double x, double y) const {
        for (const Box& b : boxes)
            if (x > b.x0 && x < b.x1 && y > b.y0 && y < b.y1) return b.gray;
        return 0.5;
    }
};

// The town as `camera` sees it, four samples a pixel.
Image view_of(const Town& town, const Pinhole& camera, const Eigen::Matrix3d& town_from_camera) {
    Image image(camera.width, camera.height);
    for (int v = 0; v < camera.height; ++v)
        for (int u = 0; u < camera.width; ++u)
            for (const double dv : {-0.25, 0.25})
                for (const double du : {-0.25, 0.25}) {
                    const Eigen::Vector3d ray =
                        town_from_camera * unproject(camera, u + du, v + dv, 1);
                    image.row(v)[u] +=
                        static_cast<float>(0.25 * town.at(ray.x() / ray.z(), ray.y() / ray.z()));
                }
    return image;
}

struct SearchedScene {
    Rig truth;  // a rotation, no baseline
    std::vector<Image> references, sources;
};

SearchedScene searched_scene(unsigned seed, double source_hfov_deg, const Eigen::Vector3d& turn_deg,
                             int count = 3) {
    std::mt19937 random(seed);
    SearchedScene scene;
    scene.truth.reference = Pinhole::from_hfov(320, 240, 60 * kDegree);
    scene.truth.source = Pinhole::from_hfov(320, 256, source_hfov_deg * kDegree);
    scene.truth = turned(scene.truth, turn_deg * kDegree);
    for (int i = 0; i < count; ++i) {
        const Town town(random, 1.3, 250);
        scene.references.push_back(
            view_of(town, scene.truth.reference, Eigen::Matrix3d::Identity()));
        scene.sources.push_back(view_of(town, scene.truth.source, scene.truth.R().transpose()));
        for (float& value : scene.sources.back().pixels) {
            // Reversed and bent contrast, and noise.
            value = std::pow(1 - value, 0.6f) + static_cast<float>(uniform(random, -0.06, 0.06));
        }
    }
    return scene;
}

std::vector<EdgeMap> edge_maps(const std::vector<Image>& images) {
    std::vector<EdgeMap> maps;
    for (const Image& image : images) maps.push_back(edge_map(image));
    return maps;
}

SearchSpace space_around(const SearchedScene& scene) {
    SearchSpace space;
    SearchHypothesis hypothesis{scene.truth.reference, {}};
    for (int i = -15; i <= 15; ++i)
        hypothesis.sources.push_back(Pinhole::from_hfov(
            320, 256, 2 * std::atan(std::pow(1.06, i) * std::tan(30 * kDegree))));
    space.hypotheses = {hypothesis};
    space.rolls = {-4 * kDegree, 0, 4 * kDegree};
    return space;
}

// Mean distance between where the two send points at infinity, over what the source sees [px].
double distance(const Rig& a, const Rig& truth) {
    double sum = 0;
    int count = 0;
    for (int y = 10; y < 240; y += 20)
        for (int x = 10; x < 320; x += 20) {
            const Eigen::Vector2d p = mapped(truth, x, y, 1e9);
            if (p.x() < 0 || p.x() > truth.source.width - 1 || p.y() < 0 ||
                p.y() > truth.source.height - 1)
                continue;
            sum += (mapped(a, x, y, 1e9) - p).norm();
            ++count;
        }
    return sum / count;
}

// The map has 96 px to the reference's 320, scales step by 6 % and rolls by 4 deg: what the search
// leaves is about a map pixel and half of either step.
constexpr double kFewPixels = 8;

TEST(Search, FindsTheSameFieldOfViewTurned) {
    const SearchedScene scene = searched_scene(1, 60, {3, -5, 0});
    const auto found = global_search(edge_maps(scene.references), edge_maps(scene.sources),
                                     space_around(scene), 2);
    ASSERT_FALSE(found.empty());
    EXPECT_LT(distance(found[0].rig, scene.truth), kFewPixels);
    EXPECT_EQ(found[0].rig.t(), Eigen::Vector3d::Zero());
    found[0].rig.validate();
}

TEST(Search, FindsANarrowerSourceOffTheAxis) {
    const SearchedScene scene = searched_scene(2, 38, {-4, 8, 1});
    const auto found = global_search(edge_maps(scene.references), edge_maps(scene.sources),
                                     space_around(scene), 2);
    ASSERT_FALSE(found.empty());
    EXPECT_LT(distance(found[0].rig, scene.truth), kFewPixels);
    EXPECT_NEAR(std::tan(found[0].rig.source.hfov() / 2) / std::tan(19 * kDegree), 1, 0.08);
}

TEST(Search, FindsAWiderSourceRolled) {
    const SearchedScene scene = searched_scene(3, 85, {2, 6, -4});
    const auto found = global_search(edge_maps(scene.references), edge_maps(scene.sources),
                                     space_around(scene), 2);
    ASSERT_FALSE(found.empty());
    EXPECT_LT(distance(found[0].rig, scene.truth), kFewPixels);
}

TEST(Search, SearchesAroundTheRotationThatItIsGiven) {
    const SearchedScene scene = searched_scene(4, 60, {5, 30, 0});
    SearchSpace space = space_around(scene);
    space.base = turned({}, Eigen::Vector3d(5, 28, 0) * kDegree).R();
    space.max_shift = 0.15;
    const auto found =
        global_search(edge_maps(scene.references), edge_maps(scene.sources), space, 2);
    ASSERT_FALSE(found.empty());
    EXPECT_LT(distance(found[0].rig, scene.truth), kFewPixels);
}

TEST(Search, StaysWithinTheShiftThatItIsGiven) {
    const SearchedScene scene = searched_scene(5, 60, {0, 18, 0});
    SearchSpace space = space_around(scene);
    space.max_shift = 0.1;  // 18 deg are about 0.3
    for (const SearchCandidate& candidate :
         global_search(edge_maps(scene.references), edge_maps(scene.sources), space, 2)) {
        const Eigen::AngleAxisd turn(candidate.rig.R());
        EXPECT_LT(std::abs(turn.angle() * turn.axis().y()), 8 * kDegree);
    }
}

TEST(Search, CandidatesComeBestFirstAreDistinctAndNoMoreThanAskedFor) {
    const SearchedScene scene = searched_scene(6, 50, {2, 3, 0});
    SearchSpace space = space_around(scene);
    for (const int most : {1, 5}) {
        space.options.candidates = most;
        const auto found =
            global_search(edge_maps(scene.references), edge_maps(scene.sources), space, 2);
        ASSERT_FALSE(found.empty());
        EXPECT_LE(found.size(), static_cast<std::size_t>(most));
        for (std::size_t i = 0; i < found.size(); ++i) {
            EXPECT_GE(found[i].overlap, space.options.min_overlap);
            EXPECT_LE(found[i].overlap, 1.01);
            EXPECT_LE(std::abs(found[i].correlation), 1.01);
            for (std::size_t k = 0; k < i; ++k) {
                EXPECT_GE(found[k].score, found[i].score);
                EXPECT_GT(distance(found[k].rig, found[i].rig), 2);
            }
        }
    }
}

TEST(Search, TheNumberOfThreadsHasNoSay) {
    const SearchedScene scene = searched_scene(7, 50, {2, 3, 2}, 2);
    const SearchSpace space = space_around(scene);
    const auto one = global_search(edge_maps(scene.references), edge_maps(scene.sources), space, 1);
    ASSERT_FALSE(one.empty());
    for (const int threads : {1, 2, 3}) {
        const auto other =
            global_search(edge_maps(scene.references), edge_maps(scene.sources), space, threads);
        ASSERT_EQ(other.size(), one.size());
        for (std::size_t i = 0; i < one.size(); ++i) {
            EXPECT_EQ(other[i].score, one[i].score);
            EXPECT_EQ(other[i].rig.source.fx, one[i].rig.source.fx);
            EXPECT_EQ(other[i].rig.R(), one[i].rig.R());
        }
    }
}

}  // namespace
}  // namespace xcalib

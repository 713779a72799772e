// What the source camera cannot see, against rays cast through a scene of boards before a wall.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "every_target.hpp"
#include "refusal.hpp"
#include "register/register_rows.hpp"
#include "scenes.hpp"
#include "xcalib/register.hpp"

namespace xcalib {
namespace {

using namespace ::xcalib::testing;  // NOLINT: scenes.hpp, refusal.hpp

constexpr int kStreetWidth = 640, kStreetHeight = 480;
constexpr std::uint8_t kOccluded = static_cast<std::uint8_t>(Validity::occluded);

// Upright boards, within the reference's view, and a wall that is not square to it: planes
// z = z0 + slope * x.
struct Board {
    double z0, slope, left, right, top, bottom;  // [m], in the reference camera's axes
};
const std::vector<Board> kScene{
    {18, 0.3, -100, 100, -100, 100}, {4, 0.0, -1.2, -0.5, -0.6, 0.5},
    {5, -0.2, 0.3, 1.4, -0.3, 1.2},  {7, 0.1, -2.2, -1.6, -1.6, 1.7},
    {9, 0.0, 1.8, 2.6, -1.7, -0.3},  {3, 0.0, -0.1, 0.15, 0.4, 0.9},
};

// Depth at which the ray from `origin` along `ray` meets the board, in units of the ray; 0 if it
// does not.
double meets(const Board& b, const Eigen::Vector3d& origin, const Eigen::Vector3d& ray) {
    const double s = (b.z0 + b.slope * origin.x() - origin.z()) / (ray.z() - b.slope * ray.x());
    const Eigen::Vector3d p = origin + s * ray;
    const bool on = p.x() >= b.left && p.x() <= b.right && p.y() >= b.top && p.y() <= b.bottom;
    return s > 0 && on ? s : 0;
}

struct Rendered {
    Image depth{kStreetWidth, kStreetHeight};
    std::vector<bool> hidden;  // from the source camera
};

Rendered rendered(const Rig& rig) {
    Rendered out;
    const Eigen::Vector3d eye = -rig.R().transpose() * rig.t();
    for (int y = 0; y < kStreetHeight; ++y)
        for (int x = 0; x < kStreetWidth; ++x) {
            const Eigen::Vector3d ray = unproject(rig.reference, x, y, 1);
            double nearest = 1e9;
            for (const Board& board : kScene) {
                const double s = meets(board, Eigen::Vector3d::Zero(), ray);
                if (s > 0) nearest = std::min(nearest, s);
            }
            out.depth.row(y)[x] = static_cast<float>(nearest);
            bool hidden = false;
            for (const Board& board : kScene) {
                const double s = meets(board, eye, nearest * ray - eye);
                hidden |= s > 0 && s < 1 - 1e-6;
            }
            out.hidden.push_back(hidden);
        }
    return out;
}

struct Registered {
    std::vector<float> image = std::vector<float>(kStreetWidth * kStreetHeight);
    std::vector<std::uint8_t> mask = std::vector<std::uint8_t>(kStreetWidth * kStreetHeight);
};

Registered registered(const Rig& rig, const Image& source, const Image& depth,
                      const RegistrarOptions& options) {
    Registered out;
    Registrar(rig, options)
        .register_frame(
            source.view(), depth.view(),
            {out.image.data(), kStreetWidth, kStreetHeight, 1, PixelType::f32, 4 * kStreetWidth},
            out.mask.data());
    return out;
}

Rig rig_at(const Eigen::Vector3d& source_position, int source_width, int source_height,
           double hfov) {
    Rig rig{Pinhole::from_hfov(kStreetWidth, kStreetHeight, 0.9),
            Pinhole::from_hfov(source_width, source_height, hfov),
            {}};
    rig = turned(rig, {0.01, -0.02, 0.015});
    rig.source_from_reference.translation = -rig.R() * source_position;
    return rig;
}

TEST(Occlusion, IsWhatTheRaysSay) {
    struct Case {
        const char* name;
        Eigen::Vector3d position;
        int width, height;
        double hfov;
        Lens source_lens = {}, reference_lens = {};
        double roll = 0;
        bool mirrored = false;
    };
    const Lens barrel(LensModel::brown, {-0.3, 0.1, 0.002, 0.001});
    const Lens fisheye(LensModel::fisheye, {0.02, 0, 0, 0});
    for (const Case& c : {Case{"right", {0.3, 0.01, 0.02}, 320, 256, 0.85},
                          Case{"left", {-0.3, 0, -0.03}, 640, 512, 0.9},
                          Case{"above", {0.01, -0.3, 0}, 320, 256, 0.85},
                          Case{"below, finer", {0, 0.25, 0.02}, 1280, 1024, 0.9},
                          Case{"aslant", {-0.25, 0.25, 0.05}, 480, 384, 0.95},
                          Case{"narrow", {0.3, 0.02, 0}, 640, 512, 0.45},
                          Case{"down a little", {-0.3, 0.05, 0}, 640, 512, 0.9},
                          Case{"up a little, ahead", {0.3, -0.05, 0.04}, 640, 512, 0.9},
                          Case{"on its side", {0.3, 0.03, 0}, 512, 640, 0.75, {}, {}, 1.57},
                          Case{"mirrored", {0.3, 0.03, 0}, 640, 512, 0.9, {}, {}, 0, true},
                          Case{"source lens", {0.3, 0.01, 0}, 640, 512, 0.95, barrel},
                          Case{"source fisheye", {-0.3, 0.01, 0}, 320, 256, 0.95, fisheye},
                          Case{"reference lens", {0.3, 0, 0}, 640, 512, 0.95, {}, barrel},
                          Case{"both", {0.2, 0.2, 0}, 480, 384, 0.95, barrel, fisheye}}) {
        Rig rig = rig_at(c.position, c.width, c.height, c.hfov);
        rig.source.lens = c.source_lens;
        rig.reference.lens = c.reference_lens;
        rig = turned(rig, {0, 0, c.roll});
        rig.source_from_reference.translation = -rig.R() * c.position;
        if (c.mirrored) rig = with_flipped_source(rig);
        const Rendered scene = rendered(rig);
        const Image source(c.width, c.height, 1.0f);
        const Registered all =
            registered(rig, source, scene.depth, {1, false, Occlusion::ignore, 0});
        const Registered found =
            registered(rig, source, scene.depth, {1, false, Occlusion::hide, 0});
        int hidden = 0, visible = 0, hits = 0, lost = 0;
        for (int i = 0; i < kStreetWidth * kStreetHeight; ++i) {
            if (all.mask[i] != 0) {
                ASSERT_EQ(found.mask[i], all.mask[i]);
                continue;
            }
            ASSERT_TRUE(found.mask[i] == 0 || found.mask[i] == kOccluded);
            ASSERT_EQ(found.image[i], found.mask[i] == 0 ? 1.0f : 0.0f);
            const bool gone = found.mask[i] == kOccluded;
            (scene.hidden[i] ? hidden : visible)++;
            hits += gone && scene.hidden[i];
            lost += gone && !scene.hidden[i];
        }
        EXPECT_GT(hidden, visible / 100) << c.name;
        EXPECT_GE(hits, 0.98 * hidden) << c.name << ": " << hits << " of " << hidden;
        EXPECT_LE(lost, 0.005 * visible) << c.name << ": " << lost << " of " << visible;
    }
}

TEST(Occlusion, MarkedPixelsKeepWhatTheSourceShowsThere) {
    const Rig rig = rig_at({0.3, 0.01, 0.02}, 320, 256, 0.85);
    const Rendered scene = rendered(rig);
    Image source(320, 256);
    for (std::size_t i = 0; i < source.pixels.size(); ++i)
        source.pixels[i] = static_cast<float>(1 + i % 7);
    const auto with = [&](Occlusion occlusion, bool nearest) {
        return registered(rig, source, scene.depth, {2, nearest, occlusion, 0});
    };
    std::vector<float> marked_map(2 * kStreetWidth * kStreetHeight), map = marked_map,
                                                                     hidden_map = map;
    Registrar(rig, {2, false, Occlusion::ignore, 0}).map(scene.depth.view(), map.data());
    Registrar(rig, {2, false, Occlusion::mark, 0}).map(scene.depth.view(), marked_map.data());
    Registrar(rig, {2, false, Occlusion::hide, 0}).map(scene.depth.view(), hidden_map.data());
    for (const bool nearest : {false, true}) {
        const Registered all = with(Occlusion::ignore, nearest);
        const Registered marked = with(Occlusion::mark, nearest);
        const Registered hidden = with(Occlusion::hide, nearest);
        int count = 0;
        for (int i = 0; i < kStreetWidth * kStreetHeight; ++i) {
            ASSERT_EQ(marked.mask[i], hidden.mask[i]);
            ASSERT_EQ(marked.image[i], all.image[i]);
            const bool gone = marked.mask[i] == kOccluded;
            ASSERT_EQ(hidden.image[i], gone ? 0.0f : all.image[i]);
            ASSERT_EQ(std::isnan(hidden_map[2 * i]), gone || std::isnan(map[2 * i]));
            if (!std::isnan(map[2 * i])) {
                ASSERT_EQ(marked_map[2 * i], map[2 * i]);
            }
            count += gone;
        }
        EXPECT_GT(count, 1000);
    }
}

TEST(Occlusion, NothingHidesOnOneSurface) {
    for (const Eigen::Vector3d& position : {Eigen::Vector3d(0.3, 0, 0), Eigen::Vector3d(0, -0.3, 0),
                                            Eigen::Vector3d(0.2, 0.2, 0.3)}) {
        const Rig rig = rig_at(position, 320, 256, 0.9);
        // A road up to the horizon: depth grows by far more than any tolerance from row to row.
        Image road(kStreetWidth, kStreetHeight);
        for (int y = 0; y < kStreetHeight; ++y)
            for (int x = 0; x < kStreetWidth; ++x)
                road.row(y)[x] = y > 250 ? static_cast<float>(1.5 * 600 / (y - 249)) : 0.0f;
        const Registered out =
            registered(rig, Image(320, 256, 1.0f), road, {1, false, Occlusion::hide, 0});
        EXPECT_EQ(std::count(out.mask.begin(), out.mask.end(), kOccluded), 0) << position;
    }
}

TEST(Occlusion, CamerasAtOnePlaceSeeTheSame) {
    const Rig rig = rig_at({0, 0, 0}, 320, 256, 0.9);
    const Registered out =
        registered(rig, Image(320, 256, 1.0f), rendered(rig).depth, {1, false, Occlusion::hide, 0});
    for (const std::uint8_t code : out.mask) ASSERT_NE(code, kOccluded);
}

void expect_the_same_on_every_path(const Rig& rig) {
    const Rendered scene = rendered(rig);
    std::mt19937 random(1);
    Image source(320, 256);
    for (float& value : source.pixels) value = static_cast<float>(uniform(random, 0, 1));
    const Registered expected =
        registered(rig, source, scene.depth, {1, false, Occlusion::hide, 0});
    for (const int threads : {2, 3, 16, 0}) {
        const Registered out =
            registered(rig, source, scene.depth, {threads, false, Occlusion::hide, 0});
        EXPECT_EQ(out.mask, expected.mask) << threads << " threads";
        EXPECT_EQ(out.image, expected.image) << threads << " threads";
    }
    on_every_target([&] {
        const Registered out = registered(rig, source, scene.depth, {1, false, Occlusion::hide, 0});
        // How many pixels are looked at together depends on the vector's length.
        int differ = 0;
        for (std::size_t i = 0; i < out.mask.size(); ++i) differ += out.mask[i] != expected.mask[i];
        EXPECT_LT(differ, kStreetWidth * kStreetHeight / 500);
    });
}

TEST(Occlusion, IsTheSameOnEveryPathAndWithAnyNumberOfThreads) {
    Rig rig = rig_at({0.3, 0.02, 0.05}, 320, 256, 0.85);
    expect_the_same_on_every_path(rig);
    rig.source.lens = Lens(LensModel::brown, {-0.3, 0.1, 0.002, 0.001});
    expect_the_same_on_every_path(rig);
}

// Beside the rows of cells: the same by a grid of them, which takes no direction for granted.
TEST(Occlusion, RowsServeRigsSideBySide) {
    for (const double x : {0.3, -0.3}) {
        const Rig beside = rig_at({x, 0.02, 0.02}, 320, 256, 0.85);
        const RowGrid rows(beside);
        EXPECT_TRUE(rows.serves);
        EXPECT_TRUE(rows.along_u);
        EXPECT_EQ(rows.near_lies_back, x > 0);
        const RowGrid mirrored(with_flipped_source(beside));
        EXPECT_TRUE(mirrored.serves);
        EXPECT_LT(mirrored.per_pixel, 0);
        // What is near moves towards what the source camera is beside, however its image lies.
        EXPECT_EQ(mirrored.near_lies_back, x > 0);
        Rig lying = turned(beside, {0, 0, 1.57});
        lying.source_from_reference.translation = -lying.R() * Eigen::Vector3d(x, 0.02, 0.02);
        const RowGrid on_its_side(lying);
        EXPECT_TRUE(on_its_side.serves);
        EXPECT_FALSE(on_its_side.along_u);
        EXPECT_EQ(on_its_side.near_lies_back, x > 0);
    }
    for (const Eigen::Vector3d& position :
         {Eigen::Vector3d(0.01, 0.3, 0), {0.2, 0.2, 0}, {0.01, 0, 0.3}})
        EXPECT_FALSE(RowGrid(rig_at(position, 320, 256, 0.85)).serves) << position;
}

// Shadows fall from one row to others, and up as well as down.
TEST(Occlusion, ShadowsFallAcrossRows) {
    for (const double y : {0.05, -0.05}) {
        const Rig rig = rig_at({0.3, y, 0}, 320, 256, 0.85);
        const RowGrid rows(rig);
        ASSERT_TRUE(rows.serves);
        const Shadows shadows = rows.shadows(0, rows.rows_at_a_time());
        EXPECT_EQ(shadows.down, y < 0);  // from a camera below, what is hidden lies above
        EXPECT_GT(shadows.reach, 2);
        // Rows that something at z metres is away from what it hides far behind: f t_y / z.
        EXPECT_NEAR(shadows.longest_of_all, rig.reference.fy * 0.05, 4);
    }
}

TEST(Occlusion, GapsBetweenTheCellsOfASurfaceAreFilled) {
    std::mt19937 random(2);
    for (const int width : {2, 3, 17, 33, 40, 70}) {
        CellGrid grid;
        grid.width = width;
        grid.height = 5;
        const std::size_t size = cells_with_room(grid);
        std::vector<Nearness> parts(2 * size), joined(size, 9);
        for (Nearness& cell : parts) cell = static_cast<Nearness>(random() % 1000);
        join_cells(grid, parts.data(), 2, 0, 2, joined.data());
        join_cells(grid, parts.data(), 2, 2, 5, joined.data());
        const auto nearest = [&](int x, int y) {
            const std::size_t i = static_cast<std::size_t>(y) * width + x;
            return std::max(parts[i], parts[i + size]);
        };
        for (int y = 0; y < 5; ++y)
            for (int x = 0; x < width; ++x) {
                Nearness expected = nearest(x, y);
                if (x > 0 && x + 1 < width)
                    expected = std::max(expected, std::min(nearest(x - 1, y), nearest(x + 1, y)));
                if (y > 0 && y < 4)
                    expected = std::max(expected, std::min(nearest(x, y - 1), nearest(x, y + 1)));
                ASSERT_EQ(joined[y * width + x], expected) << x << ", " << y << " of " << width;
            }
    }
}

TEST(Occlusion, TheMapHasNoPlaceForWhatIsHidden) {
    const Rig rig = rig_at({0.3, 0.02, 0.05}, 320, 256, 0.85);
    const Rendered scene = rendered(rig);
    const Registered out =
        registered(rig, Image(320, 256, 1.0f), scene.depth, {1, false, Occlusion::hide, 0});
    std::vector<float> map(2 * kStreetWidth * kStreetHeight);
    Registrar(rig, {2, false, Occlusion::hide, 0}).map(scene.depth.view(), map.data());
    for (int i = 0; i < kStreetWidth * kStreetHeight; ++i)
        ASSERT_EQ(std::isnan(map[2 * i]), out.mask[i] != 0) << i;
}

}  // namespace
}  // namespace xcalib

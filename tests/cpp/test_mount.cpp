#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "geometry/projector.hpp"
#include "refusal.hpp"
#include "scenes.hpp"
#include "xcalib/mount.hpp"

namespace xcalib {
namespace {

using ::xcalib::testing::has;
using ::xcalib::testing::random_rig;
using ::xcalib::testing::refusal;

constexpr double kDegree = 3.14159265358979323846 / 180;

Rig rolled(double degrees) {
    const Pinhole camera = Pinhole::from_hfov(101, 101, 60 * kDegree);
    Rig rig{camera, camera, {}};
    rig.source_from_reference.rotation =
        Eigen::Quaterniond(Eigen::AngleAxisd(degrees * kDegree, Eigen::Vector3d::UnitZ()));
    return rig;
}

TEST(Mount, AQuarterTurnClockwiseShowsWhatIsOnTheRightAtTheBottom) {
    const Eigen::Vector2d p = transfer(rolled(90), 80, 50, 5);
    EXPECT_NEAR(p.x(), 50, 1e-9);
    EXPECT_NEAR(p.y(), 80, 1e-9);
    EXPECT_NEAR(Mount::of(rolled(90)).roll_deg, 90, 1e-9);
    EXPECT_NEAR(Mount::of(rolled(-120)).roll_deg, -120, 1e-9);
}

TEST(Mount, AMirrorShowsWhatIsOnTheRightOnTheLeft) {
    Rig rig = rolled(0);
    rig.source_mirrored = true;
    const Eigen::Vector2d p = transfer(rig, 80, 30, 5);
    EXPECT_NEAR(p.x(), 20, 1e-9);
    EXPECT_NEAR(p.y(), 30, 1e-9);
}

// Whatever the source's principal point and skew are.
TEST(Mount, TheRigOfFlippedSourcesSeesEveryPointInTheFlippedColumn) {
    std::mt19937 random(5);
    for (int i = 0; i < 20; ++i) {
        const Rig rig = random_rig(random, 640, 480, 320, 256);
        const Rig flipped = with_flipped_source(rig);
        EXPECT_TRUE(flipped.source_mirrored);
        const Eigen::Vector2d at = transfer(rig, 300, 200, 4),
                              there = transfer(flipped, 300, 200, 4);
        EXPECT_NEAR(there.x(), 319 - at.x(), 1e-9);
        EXPECT_NEAR(there.y(), at.y(), 1e-9);
        const Rig back = with_flipped_source(flipped);
        EXPECT_FALSE(back.source_mirrored);
        EXPECT_EQ(back.source.K(), rig.source.K());
    }
}

TEST(Mount, KernelsMirrorAsOnePointDoes) {
    std::mt19937 random(6);
    Rig rig = with_flipped_source(random_rig(random, 97, 60, 80, 64));
    const std::vector<float> depth(97, 3.0f);
    std::vector<float> u(97), v(97);
    std::vector<std::uint8_t> validity(97);
    map_row(Projector(rig), depth.data(), 31, 97, u.data(), v.data(), validity.data());
    int compared = 0;
    for (int x = 0; x < 97; ++x) {
        if (validity[x] != 0) continue;
        const Eigen::Vector2d p = transfer(rig, x, 31, 3);
        EXPECT_NEAR(u[x], p.x(), 1e-3);
        EXPECT_NEAR(v[x], p.y(), 1e-3);
        ++compared;
    }
    EXPECT_GT(compared, 10);
}

TEST(Mount, HasWordsBothWays) {
    EXPECT_FALSE(Mount::parse("--mount", "auto"));
    for (const char* word : {"upright", "90", "-12.5", "270", "mirrored", "mirrored-90"})
        EXPECT_EQ(Mount::word(Mount::parse("--mount", word)), word);
    EXPECT_EQ(Mount::word(std::nullopt), "auto");
    for (const char* word : {"", "sideways", "90deg", "mirrored90", "mirrored-", "nan", "1e9"})
        EXPECT_TRUE(has(refusal([&] { Mount::parse("--mount", word); }),
                        std::string("--mount is '") + word + "', expected auto, upright"))
            << word;
}

TEST(Mount, IsSaidInWords) {
    EXPECT_EQ((Mount{4.0, false}.text()), "upright");
    EXPECT_EQ((Mount{-178.0, false}.text()), "upside down");
    EXPECT_EQ((Mount{270.0, false}.text()), "turned by 90 deg counterclockwise");
    EXPECT_EQ((Mount{0.0, true}.text()), "mirrored");
    EXPECT_EQ((Mount{91.0, true}.text()), "turned by 91 deg clockwise, then mirrored");
}

}  // namespace
}  // namespace xcalib

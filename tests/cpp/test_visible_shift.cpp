#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "visible_shift.hpp"
#include "working_scene.hpp"

namespace xcalib {
namespace {

using namespace ::xcalib::testing;  // NOLINT: working_scene.hpp

TEST(VisibleShift, IsHowFarTheRigIsOff) {
    for (const unsigned seed : {1u, 2u, 3u}) {
        SCOPED_TRACE(seed);
        const Scene scene = make_scene(seed, 300, 2);
        EXPECT_LT(visible_shift(scene.images, scene.truth, 2), 0.5);
        for (const double turn : {0.01, 0.03}) {
            Rig rig = turned(scene.truth, {0.7 * turn, -turn, 0.0});
            rig.source.fx *= 1 + turn;
            rig.source.fy *= 1 + turn;
            const double off = end_point_error(scene, rig) * rig.reference.fx / rig.source.fx;
            EXPECT_NEAR(visible_shift(scene.images, rig, 2), off, 0.25 * off) << turn;
        }
    }
}

TEST(VisibleShift, DoesNotDependOnThreads) {
    const Scene scene = make_scene(4, 300, 2);
    const Rig rig = perturbed(scene.truth);
    EXPECT_EQ(visible_shift(scene.images, rig, 1), visible_shift(scene.images, rig, 3));
}

TEST(VisibleShift, IsUnknownWhereNothingCanBeSeen) {
    Scene scene = make_scene(5, 300, 2);
    for (Image& source : scene.images.sources)
        std::fill(source.pixels.begin(), source.pixels.end(), 0.5f);
    EXPECT_TRUE(std::isnan(visible_shift(scene.images, scene.truth, 2)));
}

}  // namespace
}  // namespace xcalib

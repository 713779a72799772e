// Rigs that should be one.
#pragma once

#include <gtest/gtest.h>

#include "xcalib/camera.hpp"

namespace xcalib::testing {

inline void expect_same(const Pinhole& a, const Pinhole& b, double tolerance) {
    EXPECT_EQ(a.width, b.width);
    EXPECT_EQ(a.height, b.height);
    EXPECT_NEAR(a.fx, b.fx, tolerance);
    EXPECT_NEAR(a.fy, b.fy, tolerance);
    EXPECT_NEAR(a.cx, b.cx, tolerance);
    EXPECT_NEAR(a.cy, b.cy, tolerance);
    EXPECT_NEAR(a.skew, b.skew, tolerance);
    EXPECT_EQ(a.lens.model(), b.lens.model());
    ASSERT_EQ(a.lens.coefficients().size(), b.lens.coefficients().size());
    for (std::size_t i = 0; i < a.lens.coefficients().size(); ++i)
        EXPECT_NEAR(a.lens.coefficients()[i], b.lens.coefficients()[i], tolerance);
}

inline void expect_same(const Rig& a, const Rig& b, double tolerance) {
    expect_same(a.reference, b.reference, tolerance);
    expect_same(a.source, b.source, tolerance);
    EXPECT_LT((a.R() - b.R()).norm(), tolerance);
    EXPECT_LT((a.t() - b.t()).norm(), tolerance);
}

}  // namespace xcalib::testing

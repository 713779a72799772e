#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "scenes.hpp"
#include "xcalib/nec.hpp"

namespace xcalib {
namespace {

using namespace ::xcalib::testing;  // NOLINT: scenes.hpp

// One pair seen by a rig whose edges vanish towards the border, so that masks do not matter, and
// the rig at which it is looked at: some pixels off.
struct EdgeScene {
    Rig truth, rig;
    Image reference, source, depth;
    NecFrame frame;
};

EdgeScene smooth_scene(unsigned seed, int width = 200, int height = 150) {
    std::mt19937 random(seed);
    EdgeScene scene;
    const int source_width = width * 9 / 10, source_height = height * 9 / 10;
    scene.truth = random_rig(random, width, height, source_width, source_height);
    scene.truth.source.fx = scene.truth.source.fy = 0.85 * scene.truth.reference.fx;
    const Field texture = blobs(random, width, height, 14, 0.06 * width, 0.5);
    const Field depth = rolling_depth(width, height);
    scene.reference = drawn(texture, width, height);
    scene.depth = drawn(depth, width, height);
    // A contrast of its own: partly reversed, not a function of the reference's polarity.
    scene.source = source_view(
        scene.truth,
        [&](double x, double y) {
            return 0.5 + (texture(x, y) - 0.5) * std::sin(0.03 * x - 0.02 * y);
        },
        depth);
    scene.rig = turned(scene.truth, {0.01, -0.012, 0.008});
    scene.rig.source_from_reference.translation += Eigen::Vector3d(0.05, -0.03, 0.04);
    scene.rig.source.fx *= 1.02;
    scene.frame = make_nec_frame(scene.reference, scene.source, scene.depth, scene.rig);
    return scene;
}

double relative_error(const Eigen::MatrixXd& found, const Eigen::MatrixXd& expected) {
    return (found - expected).norm() / expected.norm();
}

// --- Edges
// ----------------------------------------------------------------------------------------

TEST(EdgeField, TakesTheFloorOffAndStopsAtTheCap) {
    // Slopes along x, then along y; the mean magnitude is given as 1.
    for (const auto& [slope, expected] : {std::pair{0.25f, 0.0f}, {1.0f, 0.7f}, {9.0f, 1.7f}}) {
        const auto along_x = drawn([s = slope](double x, double) { return s * x; }, 7, 5);
        const auto along_y = drawn([s = slope](double, double y) { return -s * y; }, 7, 5);
        const EdgeField x = edge_field(along_x, 1.0f), y = edge_field(along_y, 1.0f);
        const std::size_t middle = 2 * 7 + 3;
        EXPECT_NEAR(x.x[middle], expected, 1e-5);
        EXPECT_NEAR(x.y[middle], 0, 1e-5);
        EXPECT_NEAR(y.x[middle], 0, 1e-5);
        EXPECT_NEAR(y.y[middle], -expected, 1e-5);
        EXPECT_EQ(x.x[3], 0) << "the rim has no stencil";
        EXPECT_EQ(x.x[4 * 7 + 3], 0);
        EXPECT_EQ(x.x[2 * 7], 0);
        EXPECT_EQ(x.x[2 * 7 + 6], 0);
    }
}

TEST(EdgeField, KeepsTheDirection) {
    const Image ramp = drawn([](double x, double y) { return 3 * x + 4 * y; }, 5, 5);  // g = 5
    const EdgeField field = edge_field(ramp, 5.0f);  // 1.5 is taken off
    EXPECT_NEAR(field.x[12], 3 * 0.7, 1e-5);
    EXPECT_NEAR(field.y[12], 4 * 0.7, 1e-5);
}

TEST(MeanGradient, LeavesTheRimOut) {
    // g = 1 on the left, 3 on the right; wide enough for whole vectors and a rest.
    for (int width : {11, 41}) {
        const int bend = width / 2;
        const Image image =
            drawn([&](double x, double) { return x < bend ? x : bend + 3 * (x - bend); }, width, 3);
        const int inner = bend - 1;  // on both sides, and one of 2 at the bend
        EXPECT_NEAR(mean_gradient(image), (inner * 1 + 2 + inner * 3) / double(width - 2), 1e-5);
    }
    EXPECT_EQ(mean_gradient(Image(2, 9, 1.0f)), 0);
}

TEST(MeanGradient, OfTheWarpedSourceIsOverPixelsWhoseStencilIsValid) {
    // As before; the rig maps each pixel onto itself.
    const Image image = drawn([](double x, double) { return x < 5 ? x : 5 + 3 * (x - 5); }, 11, 3);
    Rig rig;
    rig.reference = rig.source = Pinhole::from_hfov(11, 3, 0.7);
    Image depth(11, 3, 5.0f);
    EXPECT_NEAR(make_nec_frame(image, image, depth, rig).source_mean, (4 * 1 + 2 + 4 * 3) / 9.0,
                1e-4);
    depth.row(1)[7] = 0;  // takes itself and its neighbours in the row out
    EXPECT_NEAR(make_nec_frame(image, image, depth, rig).source_mean, (4 * 1 + 2 + 3) / 6.0, 1e-4);
    EXPECT_EQ(make_nec_frame(image, image, Image(11, 3), rig).source_mean, 0);
}

// --- The objective
// --------------------------------------------------------------------------------

TEST(Nec, HalfTheSumOfSquaresIsOneMinusNec) {
    for (unsigned seed = 1; seed <= 4; ++seed) {
        const EdgeScene scene = smooth_scene(seed);
        const NecRows rows = nec_rows(scene.frame, scene.rig, Parameters(kNumParameters));
        const double nec = evaluate_nec(scene.frame, scene.rig).nec;
        EXPECT_GT(nec, 0.3);
        EXPECT_LT(nec, 0.98);
        EXPECT_NEAR(0.5 * rows.residuals.squaredNorm(), 1 - nec, 1e-7);
    }
}

TEST(Nec, NormalEquationsAreThoseOfTheRows) {
    for (const int count : {int{kNumWithoutReference}, int{kNumParameters}})
        for (unsigned seed = 1; seed <= 4; ++seed) {
            const EdgeScene scene = smooth_scene(seed, 80, 60);
            const NecRows rows = nec_rows(scene.frame, scene.rig, Parameters(count));
            const NecNormalEquations equations =
                nec_normal_equations(scene.frame, scene.rig, Parameters(count));
            ASSERT_EQ(rows.jacobian.cols(), count);
            ASSERT_EQ(equations.hessian.rows(), count);
            ASSERT_GT(rows.jacobian.rows(), 500);
            const Eigen::MatrixXd hessian = rows.jacobian.transpose() * rows.jacobian;
            const Eigen::VectorXd gradient = rows.jacobian.transpose() * rows.residuals;
            EXPECT_LT(relative_error(equations.hessian, hessian), 2e-7);
            EXPECT_LT(relative_error(equations.gradient, gradient), 2e-7);
            EXPECT_EQ(equations.hessian, equations.hessian.transpose());
        }
}

TEST(Nec, TheReferencesParametersComeAfterTheOthersAndChangeNothingThere) {
    const EdgeScene scene = smooth_scene(5, 80, 60);
    const auto some =
        nec_normal_equations(scene.frame, scene.rig, Parameters(kNumWithoutReference));
    const auto all = nec_normal_equations(scene.frame, scene.rig, Parameters(kNumParameters));
    constexpr int n = kNumWithoutReference;
    EXPECT_LT(relative_error(all.hessian.topLeftCorner(n, n), some.hessian), 1e-12);
    EXPECT_LT(relative_error(all.gradient.head(n), some.gradient), 1e-12);
}

// A central difference is the mean of the derivative over its step. The analytic gradient is
// averaged over the same step, so that the kinks of bilinear interpolation, where a pixel passes
// from one cell to the next, have no say; each class is judged over some scenes together, since
// what sampling leaves of the kinks is large beside a gradient that happens to be near zero. That
// the derivatives are right is what this shows, not that a fit converges: test_solve.cpp does that.
TEST(Nec, GradientAgreesWithCentralDifferencesPerParameterClass) {
    for (const bool saturated : {false, true}) {
        Eigen::MatrixXd found(kNumParameters, 3), expected(kNumParameters, 3);
        int scene = 0;
        for (const unsigned seed : {1u, 5u, 6u}) {
            const SmoothPair pair = smooth_pair(seed, saturated);
            const WarpedImage warped = warp(pair.rig, pair.frame.source, pair.frame.depth);
            for (const std::uint8_t v : warped.validity) ASSERT_EQ(v, 0);
            for (int p = 0; p < kNumParameters; ++p) {
                const double step = 2.5 / farthest_move(pair.rig, p);
                const auto cost = [&](double s) {
                    return 1 - evaluate_nec(pair.frame, moved(pair.rig, p, s)).nec;
                };
                expected(p, scene) = (cost(step) - cost(-step)) / (2 * step);
                constexpr int kSamples = 300;
                double sum = 0;
                for (int i = 0; i < kSamples; ++i) {
                    const Rig rig = moved(pair.rig, p, step * ((2 * i + 1.0) / kSamples - 1));
                    sum += nec_normal_equations(pair.frame, rig, Parameters(p + 1)).gradient[p];
                }
                found(p, scene) = sum / kSamples;
            }
            ++scene;
        }
        for (const ParameterClass& group : kParameterClasses) {
            const Eigen::MatrixXd numeric = expected.middleRows(group.first, group.count);
            const Eigen::MatrixXd analytic = found.middleRows(group.first, group.count);
            EXPECT_LT(relative_error(analytic, numeric), 1e-4)
                << group.name << (saturated ? ", saturated:\n" : ":\n") << analytic << "\nagainst\n"
                << numeric;
        }
    }
}

// Edges that come up through the floor, reach the cap or change polarity are kinks of the cost.
TEST(Nec, GradientHoldsOnAverageWhereEdgesComeAndGo) {
    for (unsigned seed = 1; seed <= 3; ++seed) {
        const EdgeScene scene = smooth_scene(seed);
        const Eigen::Vector3d direction(0.5, -0.7, 0.3);
        const double reach = 0.02;  // [rad], some pixels
        const auto rig_at = [&](double s) { return turned(scene.rig, s * direction); };
        double integral = 0;
        constexpr int kSamples = 400;
        for (int i = 0; i < kSamples; ++i) {
            const Rig rig = rig_at(reach * (i + 0.5) / kSamples);
            integral += nec_normal_equations(scene.frame, rig, Parameters(kNumWithoutReference))
                            .gradient.segment<3>(kRotationX)
                            .dot(direction) *
                        reach / kSamples;
        }
        const double change =
            evaluate_nec(scene.frame, rig_at(0)).nec - evaluate_nec(scene.frame, rig_at(reach)).nec;
        EXPECT_GT(std::abs(change), 0.01);
        EXPECT_NEAR(integral, change, 2e-3 * std::abs(change)) << "seed " << seed;
    }
}

TEST(Nec, TheCheapValueIsTheFullOne) {
    for (unsigned seed = 1; seed <= 4; ++seed) {
        const EdgeScene scene = smooth_scene(seed, 80, 60);
        const NecValue cheap = evaluate_nec(scene.frame, scene.rig);
        const NecValue full =
            nec_normal_equations(scene.frame, scene.rig, Parameters(kNumWithoutReference)).value;
        EXPECT_NEAR(cheap.nec, full.nec, 1e-7);
        EXPECT_NEAR(cheap.norm, full.norm, 1e-7 * full.norm);
        EXPECT_NEAR(cheap.aligned, full.aligned, 1e-6);
        EXPECT_DOUBLE_EQ(cheap.valid_share, full.valid_share);
    }
}

TEST(Nec, ReversedContrastOfTheSourceChangesNothing) {
    const EdgeScene scene = smooth_scene(6, 80, 60);
    Image reversed = scene.source;
    for (float& value : reversed.pixels) value = 1 - value;
    const NecFrame frame = make_nec_frame(scene.reference, reversed, scene.depth, scene.rig);
    const auto one = nec_normal_equations(scene.frame, scene.rig, Parameters(kNumParameters));
    const auto other = nec_normal_equations(frame, scene.rig, Parameters(kNumParameters));
    EXPECT_NEAR(one.value.nec, other.value.nec, 1e-5);
    EXPECT_LT(relative_error(other.hessian, one.hessian), 1e-5);
    EXPECT_LT(relative_error(other.gradient, one.gradient), 1e-4);
}

TEST(Nec, IsOneWhereTheRigExplainsTheSourceAndLessWhereItDoesNot) {
    std::mt19937 random(7);
    const Pinhole camera = Pinhole::from_hfov(120, 90, 0.9);
    const Rig rig{camera, camera, {}};
    const Image image = drawn(blobs(random, 120, 90, 14, 7, 0.6), 120, 90);
    const Image depth(120, 90, 4.0f);
    const NecFrame frame = make_nec_frame(image, image, depth, rig);
    const NecValue value = evaluate_nec(frame, rig);
    EXPECT_NEAR(value.nec, 1, 1e-6);
    EXPECT_NEAR(value.aligned, 1, 1e-6);
    EXPECT_NEAR(value.norm, frame.reference_energy, 1e-4 * frame.reference_energy);
    double last = value.nec;
    for (const double angle : {0.01, 0.02, 0.04}) {
        const double nec = evaluate_nec(frame, turned(rig, {0, angle, 0})).nec;
        EXPECT_LT(nec, last - 0.01);
        last = nec;
    }
    const auto equations = nec_normal_equations(frame, rig, Parameters(kNumWithoutReference));
    EXPECT_LT(equations.gradient.norm(), 1e-4 * equations.hessian.norm());
}

TEST(Nec, PixelsOfUnknownDepthAndTheirStencilsDoNotCount) {
    EdgeScene scene = smooth_scene(8, 120, 90);
    // A hole in the depth, and a source that differs only where the hole's pixels look.
    const int x0 = 45, x1 = 75, y0 = 30, y1 = 60;
    for (int y = y0; y < y1; ++y)
        for (int x = x0; x < x1; ++x) scene.depth.row(y)[x] = 0.0f;
    Image changed = scene.source;
    const Field depth = rolling_depth(120, 90);
    int count = 0;
    for (int y = y0 + 6; y < y1 - 6; ++y)
        for (int x = x0 + 6; x < x1 - 6; ++x, ++count) {
            const Eigen::Vector2d p = mapped(scene.rig, x, y, depth(x, y));
            changed.row(static_cast<int>(p.y()))[static_cast<int>(p.x())] += 0.3f;
        }
    ASSERT_GT(count, 100);
    const NecFrame one = make_nec_frame(scene.reference, scene.source, scene.depth, scene.rig);
    const NecFrame other = make_nec_frame(scene.reference, changed, scene.depth, scene.rig);
    EXPECT_EQ(one.source_mean, other.source_mean);
    EXPECT_EQ(evaluate_nec(one, scene.rig).nec, evaluate_nec(other, scene.rig).nec);
    EXPECT_EQ(nec_normal_equations(one, scene.rig, Parameters(kNumParameters)).hessian,
              nec_normal_equations(other, scene.rig, Parameters(kNumParameters)).hessian);
    // The same change does count where the depth is known.
    const NecFrame known =
        make_nec_frame(scene.reference, changed, drawn(depth, 120, 90), scene.rig);
    EXPECT_GT(
        std::abs(evaluate_nec(known, scene.rig).nec - evaluate_nec(scene.frame, scene.rig).nec),
        1e-3);
}

TEST(Nec, TheReferencesEdgesBesideAHoleInTheDepthDoNotCount) {
    EdgeScene scene = smooth_scene(9, 120, 90);
    scene.depth.row(45)[60] = 0.0f;
    const NecFrame one = make_nec_frame(scene.reference, scene.source, scene.depth, scene.rig);
    NecFrame other = one;
    for (const auto& [x, y] : {std::pair{60, 45}, {59, 45}, {61, 45}, {60, 44}, {60, 46}})
        other.reference.x[y * 120 + x] = 7.0f;
    EXPECT_EQ(evaluate_nec(one, scene.rig).nec, evaluate_nec(other, scene.rig).nec);
    other.reference.x[45 * 120 + 62] = 7.0f;
    EXPECT_NE(evaluate_nec(one, scene.rig).nec, evaluate_nec(other, scene.rig).nec);
}

TEST(Nec, TheRimOfTheWarpIsNotAnEdge) {
    // A bright, constant source that covers half of the reference has no edge at all.
    std::mt19937 random(10);
    const Pinhole camera = Pinhole::from_hfov(120, 90, 0.9);
    const Rig rig = turned({camera, camera, {}}, {0, 0.4, 0});
    const Image image = drawn(blobs(random, 120, 90, 14, 7, 0.9), 120, 90);
    const NecFrame frame = make_nec_frame(image, Image(120, 90, 1.0f), Image(120, 90, 4.0f), rig);
    const NecValue value = evaluate_nec(frame, rig);
    EXPECT_GT(value.valid_share, 0.1);
    EXPECT_LT(value.valid_share, 0.9);
    EXPECT_EQ(value.nec, 0);
    EXPECT_EQ(value.norm, 0);
}

TEST(Nec, ValidShareIsTheCoveredEdgeEnergy) {
    const EdgeScene scene = smooth_scene(11, 120, 90);
    EXPECT_NEAR(evaluate_nec(scene.frame, scene.rig).valid_share, 1, 0.02);
    // Half of the depth unknown: what is left is all there is to cover.
    Image half = scene.depth;
    for (int y = 0; y < 90; ++y) std::fill_n(half.row(y), 60, 0.0f);
    const NecFrame frame = make_nec_frame(scene.reference, scene.source, half, scene.rig);
    EXPECT_NEAR(evaluate_nec(frame, scene.rig).valid_share, 1, 0.05);
    EXPECT_LT(frame.reference_energy, 0.95 * scene.frame.reference_energy);
}

TEST(Nec, WithoutOverlapItIsZeroAndSoAreTheEquations) {
    const EdgeScene scene = smooth_scene(12, 80, 60);
    const Rig away = turned(scene.rig, {0, 2.5, 0});
    const auto equations = nec_normal_equations(scene.frame, away, Parameters(kNumParameters));
    EXPECT_EQ(equations.value.nec, 0);
    EXPECT_EQ(equations.value.aligned, 0);
    EXPECT_EQ(equations.value.valid_share, 0);
    EXPECT_EQ(equations.hessian, Eigen::MatrixXd::Zero(kNumParameters, kNumParameters));
    EXPECT_EQ(equations.gradient, Eigen::VectorXd::Zero(kNumParameters));
}

TEST(Nec, AlignedIsAboutZeroForUnrelatedDirections) {
    std::mt19937 random(13);
    const Pinhole camera = Pinhole::from_hfov(160, 120, 0.9);
    const Rig rig{camera, camera, {}};
    const Image depth(160, 120, 4.0f);
    double sum = 0;
    constexpr int kTrials = 20;
    for (int i = 0; i < kTrials; ++i) {
        const Image a = drawn(blobs(random, 160, 120, 60, 4, 1), 160, 120);
        const Image b = drawn(blobs(random, 160, 120, 60, 4, 1), 160, 120);
        const NecValue value = evaluate_nec(make_nec_frame(a, b, depth, rig), rig);
        EXPECT_GT(value.nec, 0.1);
        sum += value.aligned / kTrials;
    }
    EXPECT_NEAR(sum, 0, 0.04);
}

// --- The metric
// -----------------------------------------------------------------------------------

// Eq. (nec) and Eq. (gradient_clamping), straight from the page.
double metric_by_the_book(const Image& a, const Image& b, const std::vector<std::uint8_t>* valid,
                          bool printed_floor) {
    const int width = a.width, height = a.height;
    const auto counts = [&](int x, int y) {
        return !valid || ((*valid)[y * width + x] && (*valid)[y * width + x + 1] &&
                          (*valid)[(y + 1) * width + x]);
    };
    const auto gradient = [](const Image& image, int x, int y) {
        return Eigen::Vector2d(double(image.row(y)[x + 1]) - image.row(y)[x],
                               double(image.row(y + 1)[x]) - image.row(y)[x]);
    };
    struct Statistics {
        double mean = 0, active = 0, n = 0;
    };
    const auto statistics = [&](const Image& image) {
        Statistics s;
        for (int y = 0; y < height - 1; ++y)
            for (int x = 0; x < width - 1; ++x) {
                if (!counts(x, y)) continue;
                const double g = gradient(image, x, y).norm();
                s.mean += g;
                s.active += g > 0;
                s.n += 1;
            }
        s.mean /= s.n;
        s.active /= s.n;
        return s;
    };
    const Statistics sa = statistics(a), sb = statistics(b);
    const auto clamped = [&](double g, const Statistics& s) {
        const double low = printed_floor ? 2 * s.mean / s.active : 0;
        return std::max(std::min(g, 5 * s.mean), low);
    };
    double ab = 0, aa = 0, bb = 0;
    for (int y = 0; y < height - 1; ++y)
        for (int x = 0; x < width - 1; ++x) {
            if (!counts(x, y)) continue;
            const Eigen::Vector2d va = gradient(a, x, y), vb = gradient(b, x, y);
            const double ga = clamped(va.norm(), sa), gb = clamped(vb.norm(), sb);
            const double angle = std::atan2(va.y(), va.x()) - std::atan2(vb.y(), vb.x());
            ab += ga * gb * std::abs(std::cos(angle));
            aa += ga * ga;
            bb += gb * gb;
        }
    return ab / std::sqrt(aa * bb);
}

Image noise(std::mt19937& random, int width, int height) {
    Image image(width, height);
    for (float& value : image.pixels)
        // Steps, so that some pixels have no gradient, and some far above the mean.
        value = static_cast<float>(std::floor(4 * uniform(random, 0, 1)) / 4 *
                                   (random() % 40 == 0 ? 20 : 1));
    return image;
}

TEST(NecMetric, AgreesWithTheFormulaPixelByPixel) {
    std::mt19937 random(14);
    for (int i = 0; i < 5; ++i) {
        const Image a = noise(random, 23, 17), b = noise(random, 23, 17);
        std::vector<std::uint8_t> valid(23 * 17);
        for (auto& v : valid) v = random() % 5 == 0 ? 0 : 1 + random() % 255;
        EXPECT_NEAR(nec(a, b, nullptr), metric_by_the_book(a, b, nullptr, false), 1e-6);
        EXPECT_NEAR(nec(a, b, valid.data()), metric_by_the_book(a, b, &valid, false), 1e-6);
        EXPECT_NEAR(nec(a, b, nullptr, NecFloor::printed), metric_by_the_book(a, b, nullptr, true),
                    1e-6);
        EXPECT_NEAR(nec(a, b, valid.data(), NecFloor::printed),
                    metric_by_the_book(a, b, &valid, true), 1e-6);
    }
}

TEST(NecMetric, IsOneForAnImageAndItselfInAnyContrast) {
    std::mt19937 random(15);
    const Image image = drawn(blobs(random, 60, 40, 12, 5, 0.9), 60, 40);
    Image other = image;
    for (float& value : other.pixels) value = 3 - 2 * value;
    EXPECT_NEAR(nec(image, image, nullptr), 1, 1e-8);
    EXPECT_NEAR(nec(image, other, nullptr), 1, 1e-6);
    EXPECT_NEAR(nec(image, image, nullptr, NecFloor::printed), 1, 1e-8);
}

TEST(NecMetric, PerpendicularEdgesAreWorthNothing) {
    const Image across = drawn([](double x, double) { return x * x; }, 20, 20);
    const Image down = drawn([](double, double y) { return y * y; }, 20, 20);
    EXPECT_NEAR(nec(across, down, nullptr), 0, 1e-12);
    EXPECT_NEAR(nec(across, across, nullptr), 1, 1e-12);
}

TEST(NecMetric, IsNotANumberWhereNoEdgeIsLeft) {
    std::mt19937 random(16);
    const Image image = noise(random, 12, 9);
    const std::vector<std::uint8_t> none(12 * 9, 0);
    EXPECT_TRUE(std::isnan(nec(image, image, none.data())));
    EXPECT_TRUE(std::isnan(nec(image, Image(12, 9, 0.5f), nullptr)));
    EXPECT_TRUE(std::isnan(nec(image, Image(12, 9, 0.5f), nullptr, NecFloor::printed)));
}

}  // namespace
}  // namespace xcalib

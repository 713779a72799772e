// What the tests look at: rigs, and smooth scenes that are known everywhere, not only at pixels.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "objective/projection_derivative.hpp"
#include "xcalib/camera.hpp"
#include "xcalib/image.hpp"
#include "xcalib/nec.hpp"
#include "xcalib/parameters.hpp"
#include "xcalib/warp.hpp"

namespace xcalib::testing {

// A value at every place of the reference image [px].
using Field = std::function<double(double x, double y)>;

inline double uniform(std::mt19937& random, double low, double high) {
    return low + (high - low) * (random() / 4294967296.0);
}

// R <- exp(w) R, as in `Parameter`.
inline Rig turned(const Rig& rig, const Eigen::Vector3d& w) {
    Rig out = rig;
    if (w.norm() > 0)
        out.source_from_reference.rotation =
            (Eigen::Quaterniond(Eigen::AngleAxisd(w.norm(), w.normalized())) *
             rig.source_from_reference.rotation)
                .normalized();
    return out;
}

// Of any model, bending as real ones do; the images of random_rig lie within what they show.
inline Lens random_lens(std::mt19937& random) {
    const auto about = [&](double size) { return uniform(random, -size, size); };
    switch (random() % 4) {
        case 0:
            return {LensModel::brown,
                    {uniform(random, -0.4, 0.1), 0.1, about(0.005), about(0.005)}};
        case 1:
            return {LensModel::brown,
                    {uniform(random, -0.4, 0.1), 0.1, about(0.005), about(0.005), about(0.02)}};
        case 2:
            return {LensModel::brown,
                    {about(0.3), about(0.1), about(0.005), about(0.005), about(0.02),
                     uniform(random, 0, 0.3), about(0.05), about(0.01)}};
        default: return {LensModel::fisheye, {about(0.05), about(0.02), about(0.01), about(0.005)}};
    }
}

// Cameras that differ in everything, skew included; the source sees about what the reference sees.
inline Rig random_rig(std::mt19937& random, int width, int height, int source_width,
                      int source_height) {
    const auto camera = [&](int w, int h) {
        Pinhole c = Pinhole::from_hfov(w, h, uniform(random, 0.7, 1.0));
        c.fy *= uniform(random, 0.97, 1.03);
        c.cx += uniform(random, -0.02, 0.02) * w;
        c.cy += uniform(random, -0.02, 0.02) * h;
        c.skew = uniform(random, -0.02, 0.02) * w;
        return c;
    };
    Rig rig;
    rig.reference = camera(width, height);
    rig.source = camera(source_width, source_height);
    rig.source_from_reference.translation = {uniform(random, -0.3, 0.3), uniform(random, -0.1, 0.1),
                                             uniform(random, -0.1, 0.1)};
    return turned(rig, {uniform(random, -0.05, 0.05), uniform(random, -0.05, 0.05),
                        uniform(random, -0.05, 0.05)});
}

// The same with a lens on the source, the reference or both, as `i` counts, and every second one
// mirrored.
inline Rig random_bent_rig(std::mt19937& random, int i, int width, int height, int source_width,
                           int source_height) {
    Rig rig = random_rig(random, width, height, source_width, source_height);
    if (i % 3 != 0) rig.source.lens = random_lens(random);
    if (i % 3 != 1) rig.reference.lens = random_lens(random);
    return i % 2 ? with_flipped_source(rig) : rig;
}

// Eq. (3d_mapping) step by step, in double: unproject, move, project.
inline Eigen::Vector2d mapped(const Rig& rig, double x, double y, double depth) {
    return project(rig.source, rig.R() * unproject(rig.reference, x, y, depth) + rig.t());
}

// Round Gaussian blobs of both signs over a width x height image. The middle `share` of either side
// holds their centres, so that edges vanish towards the border.
inline Field blobs(std::mt19937& random, int width, int height, int count, double sigma,
                   double share) {
    struct Blob {
        double x, y, height, sigma;
    };
    std::vector<Blob> all;
    for (int i = 0; i < count; ++i)
        all.push_back({width * (0.5 + share * uniform(random, -0.5, 0.5)),
                       height * (0.5 + share * uniform(random, -0.5, 0.5)),
                       (i % 2 ? -1 : 1) * uniform(random, 0.1, 0.4),
                       sigma * uniform(random, 0.8, 1.3)});
    return [all](double x, double y) {
        double value = 0.5;
        for (const Blob& b : all)
            value += b.height * std::exp(-0.5 * (std::pow(x - b.x, 2) + std::pow(y - b.y, 2)) /
                                         (b.sigma * b.sigma));
        return value;
    };
}

// Smooth depth between about 3 and 12 m: what is near moves against what is far.
inline Field rolling_depth(int width, int height) {
    return [=](double x, double y) {
        const double u = x / width - 0.5, v = y / height - 0.5;
        return 1.0 / (0.2 + 0.12 * v + 0.05 * u + 0.06 * std::sin(5 * u) * std::cos(4 * v));
    };
}

inline Image drawn(const Field& field, int width, int height) {
    Image image(width, height);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) image.row(y)[x] = static_cast<float>(field(x, y));
    return image;
}

// What the source camera sees of a scene that `texture` and `depth` give on the reference's image:
// each source pixel's place on the reference is found by Newton's method on Eq. (3d_mapping).
inline Image source_view(const Rig& rig, const Field& texture, const Field& depth) {
    Image image(rig.source.width, rig.source.height);
    const Eigen::Matrix3d back = infinite_homography(rig).inverse();
    const auto target = [&](const Eigen::Vector2d& x) {
        return mapped(rig, x.x(), x.y(), depth(x.x(), x.y()));
    };
    for (int v = 0; v < image.height; ++v)
        for (int u = 0; u < image.width; ++u) {
            const Eigen::Vector2d wanted(u, v);
            Eigen::Vector2d x = (back * wanted.homogeneous()).hnormalized();
            for (int i = 0; i < 8; ++i) {
                constexpr double kStep = 1e-3;
                const Eigen::Vector2d at = target(x);
                Eigen::Matrix2d slope;
                slope.col(0) = (target(x + Eigen::Vector2d(kStep, 0)) - at) / kStep;
                slope.col(1) = (target(x + Eigen::Vector2d(0, kStep)) - at) / kStep;
                x += slope.inverse() * (wanted - at);
            }
            image.row(v)[u] = static_cast<float>(texture(x.x(), x.y()));
        }
    return image;
}

// A pair on which 1 - NEC is as smooth as bilinear interpolation lets it be: every edge lies
// between the floor and the cap of the objective (or, `saturated`, above the cap), every polarity
// is the same throughout, and every pixel has its place within the source, some pixels from the
// border.
struct SmoothPair {
    Rig rig;
    NecFrame frame;
};

inline SmoothPair smooth_pair(unsigned seed, bool saturated) {
    std::mt19937 random(seed);
    constexpr int kWidth = 40, kHeight = 30, kSourceWidth = 431, kSourceHeight = 345;
    // A ramp, and waves on it that bend it by less than half.
    struct Wave {
        double kx, ky, phase, height;
    };
    std::vector<Wave> waves;
    for (int i = 0; i < 6; ++i) {
        const double k = uniform(random, 9, 25) / kWidth, direction = uniform(random, 0, 6.28);
        waves.push_back({k * std::cos(direction), k * std::sin(direction), uniform(random, 0, 6.28),
                         0.08 / (kWidth * k)});
    }
    const Field texture = [waves](double x, double y) {
        double value = ((x - kWidth / 2) + 0.3 * (y - kHeight / 2)) / kWidth;
        for (const Wave& w : waves) value += w.height * std::sin(w.kx * x + w.ky * y + w.phase);
        return value;
    };
    SmoothPair pair;
    pair.rig = random_rig(random, kWidth, kHeight, kSourceWidth, kSourceHeight);
    pair.rig.source.fx *= 0.6;
    pair.rig.source.fy *= 0.6;
    // The source sees the texture where it would be at infinity, turned by a little: some pixels
    // off.
    const Eigen::Matrix3d back =
        infinite_homography(turned(pair.rig, {0.02, -0.03, 0.02})).inverse();
    const Image source = drawn(
        [&](double u, double v) {
            const Eigen::Vector2d x = (back * Eigen::Vector3d(u, v, 1)).hnormalized();
            return (saturated ? -1 : 1) * texture(x.x(), x.y());  // reversed, for a change
        },
        kSourceWidth, kSourceHeight);
    pair.frame = make_nec_frame(drawn(texture, kWidth, kHeight), source,
                                drawn(rolling_depth(kWidth, kHeight), kWidth, kHeight), pair.rig);
    pair.frame.source_mean *= saturated ? 0.2f / kEdgeCap : 1.0f;
    return pair;
}

// A rig moved by `step` along one parameter, in the solver's scaling.
inline Rig moved(const Rig& rig, int parameter, double step) {
    if (parameter >= kRotationX && parameter <= kRotationZ) {
        Eigen::Vector3d w = Eigen::Vector3d::Zero();
        w[parameter - kRotationX] = step;
        return turned(rig, w);
    }
    SolverParameters p = solver_from_rig(rig);
    const auto in_camera = [step](SolverParameters::Camera& camera, int which) {
        double* const fields[] = {&camera.log_f[0], &camera.log_f[1], &camera.center[0],
                                  &camera.center[1], &camera.skew_share[0]};
        *fields[which] += step;
    };
    if (parameter >= kSourceK1) p.source_lens[parameter - kSourceK1] += step;
    else if (parameter >= kReferenceLogFx) in_camera(p.reference, parameter - kReferenceLogFx);
    else if (parameter >= kTranslationX) p.translation[parameter - kTranslationX] += step;
    else in_camera(p.source, parameter - kSourceLogFx);
    return rig_from_solver(p, rig);
}

// The farthest that any pixel of the reference moves by a unit of the parameter [px of the source].
inline double farthest_move(const Rig& rig, int parameter) {
    double farthest = 0;
    for (const double y : {0.0, 0.5, 1.0})
        for (const double x : {0.0, 0.5, 1.0})
            farthest = std::max(farthest, warp_jacobian(rig, x * (rig.reference.width - 1),
                                                        y * (rig.reference.height - 1), 3.0)
                                              .col(parameter)
                                              .norm());
    return farthest;
}

// The classes of parameters that derivatives are judged by.
struct ParameterClass {
    const char* name;
    int first, count;
};
inline constexpr ParameterClass kParameterClasses[] = {
    {"source focal lengths", kSourceLogFx, 2},
    {"source principal point", kSourceCx, 2},
    {"source skew", kSourceSkew, 1},
    {"rotation", kRotationX, 3},
    {"translation", kTranslationX, 3},
    {"reference focal lengths", kReferenceLogFx, 2},
    {"reference principal point", kReferenceCx, 2},
    {"reference skew", kReferenceSkew, 1},
    {"source lens", kSourceK1, 2},
};

}  // namespace xcalib::testing

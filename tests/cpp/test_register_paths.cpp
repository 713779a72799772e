// The registrar's kernel on every instruction set that this machine has, against the equation in
// double.
#define HWY_WANT_AVX3_DL  // as the kernel has it

#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "every_target.hpp"
#include "geometry/projector.hpp"
#include "scenes.hpp"
#include "xcalib/register.hpp"

namespace xcalib {
namespace {

using namespace ::xcalib::testing;  // NOLINT: scenes.hpp

template <class T>
PixelType type_of() {
    return sizeof(T) == 1 ? PixelType::u8 : sizeof(T) == 2 ? PixelType::u16 : PixelType::f32;
}

template <class T>
struct Frame {
    int width, height, channels;
    std::vector<T> values;

    Frame(int w, int h, int c) : width(w), height(h), channels(c), values(std::size_t(w) * h * c) {}
    std::ptrdiff_t row_bytes() const { return std::ptrdiff_t(sizeof(T)) * width * channels; }
    ImageView view() const {
        return {values.data(), width, height, channels, type_of<T>(), row_bytes()};
    }
    MutableImageView mutable_view() {
        return {values.data(), width, height, channels, type_of<T>(), row_bytes()};
    }
    double at(int x, int y, int c) const {
        return static_cast<double>(values[(std::size_t(y) * width + x) * channels + c]);
    }
};

template <class T>
Frame<T> random_frame(std::mt19937& random, int width, int height, int channels) {
    Frame<T> frame(width, height, channels);
    const double top = std::is_floating_point_v<T> ? 1 : std::numeric_limits<T>::max() + 1.0;
    for (T& value : frame.values) value = static_cast<T>(uniform(random, 0, top));
    return frame;
}

// Where a pixel lies, in double, and how far floats may be off.
struct Place {
    double u, v, z, slack;
};

// Where lenses bend: floats are off before the source's lens and after it.
Place bent_place(const Rig& rig, int x, int y, double depth) {
    const Eigen::Vector3d ray = unproject(rig.reference, x, y, 1);
    const Eigen::Vector3d p = depth * (rig.R() * ray) + rig.t();
    const Eigen::Vector2d at = transfer(rig, x, y, depth), point = p.hnormalized();
    const Eigen::Vector3d off =
        8 * 6e-8 * (depth * rig.R().cwiseAbs() * ray.cwiseAbs() + rig.t().cwiseAbs());
    const double rounding = (off.head<2>().norm() + point.norm() * off.z()) / std::abs(p.z());
    const double f = std::max(rig.source.fx, rig.source.fy) + std::abs(rig.source.skew);
    const double bends = rig.source_lens().derivative(point).norm();
    const double centre = std::abs(rig.source.cx) + std::abs(rig.source.cy);
    return {at.x(), at.y(), p.z(),
            f * bends * (2 * rounding + 8 * 6e-8 * point.norm()) + 8 * 6e-8 * (centre + at.norm()) +
                1e-6};
}

Place place(const Rig& rig, int x, int y, double depth) {
    if (rig.reference.lens.bends() || rig.source.lens.bends()) return bent_place(rig, x, y, depth);
    const Eigen::Matrix3d h = infinite_homography(rig);
    const Eigen::Vector3d k = rig.source.K() * rig.t(), pixel(x, y, 1);
    const Eigen::Vector3d p = depth * h * pixel + k;
    // Every term may be off by some units of its last place, and the quotient's slope carries it
    // on.
    const Eigen::Vector3d off = 8 * 6e-8 * (depth * h.cwiseAbs() * pixel + k.cwiseAbs());
    const double u = p.x() / p.z(), v = p.y() / p.z(), z = std::abs(p.z());
    const double rounding =
        std::max(off.x() + std::abs(u) * off.z(), off.y() + std::abs(v) * off.z());
    return {u, v, p.z(), rounding / z + 1e-6};
}

// How far the mean of four pixels may be off, besides by its place: by rounding, and bytes, where
// they are looked up by the machine, by places to 1/256 px on both axes.
template <class T>
double allowed() {
    if (std::is_floating_point_v<T>) return 0;
#ifdef HWY_COMPILE_ONLY_STATIC
    const bool fixed = false;
#else
    const bool fixed = sizeof(T) == 1 && (hwy::SupportedTargets() & HWY_AVX3_DL);
#endif
    return 0.5 + (fixed ? 2 * 255.0 / 256 + 0.01 : 0.0);
}

// A registered frame, pixel by pixel. Returns how many pixels were valid.
template <class T, class Depth>
int expect_by_the_book(const Rig& rig, const Frame<T>& source, const std::vector<Depth>& depth,
                       double scale) {
    const int width = rig.reference.width, height = rig.reference.height;
    Frame<T> out(width, height, source.channels);
    std::vector<std::uint8_t> mask(std::size_t(width) * height, 9);
    std::vector<float> map(2 * mask.size());
    const ImageView depth_view{
        depth.data(), width, height, 1, type_of<Depth>(), std::ptrdiff_t(sizeof(Depth)) * width};
    RegistrarOptions options;
    options.num_threads = 1;
    options.occlusion = Occlusion::ignore;
    options.depth_scale = std::is_same_v<Depth, float> ? 0 : scale;
    const Registrar registrar(rig, options);
    registrar.register_frame(source.view(), depth_view, out.mutable_view(), mask.data());
    registrar.map(depth_view, map.data());
    const double right = source.width - 1, bottom = source.height - 1;
    const double range = std::is_floating_point_v<T> ? 1 : double(std::numeric_limits<T>::max());
    int valid = 0;
    for (int i = 0; i < width * height; ++i) {
        const double d = depth[i] * scale;
        const int code = mask[i];
        const std::string where = "pixel " + std::to_string(i % width) + ", " +
                                  std::to_string(i / width) + " of " + std::to_string(width) + "x" +
                                  std::to_string(height) + ", depth " + std::to_string(d);
        EXPECT_EQ(code == 0, !std::isnan(map[2 * i])) << where;
        if (!(d > 0) || std::isinf(d)) {
            EXPECT_EQ(code, 3) << where;
        } else {
            const Place p = place(rig, i % width, i / width, d);
            if (std::isnan(p.u)) {  // behind the camera, or a lens shows nothing
                if (p.z > kNearestZ * 1.01 || std::isnan(p.z)) {
                    EXPECT_EQ(code, 1) << where;
                }
                continue;
            }
            const double beyond = std::max({-p.u, p.u - right, -p.v, p.v - bottom});
            const bool behind = p.z<kNearestZ * 0.99, ahead = p.z> kNearestZ * 1.01;
            if (behind || beyond > 1e-3 + p.slack) {
                EXPECT_EQ(code, 1) << where;
            }
            if (ahead && beyond < -p.slack) {
                EXPECT_EQ(code, 0) << where;
            }
        }
        if (code != 0) {
            for (int c = 0; c < source.channels; ++c)
                EXPECT_EQ(out.at(i % width, i / width, c), 0) << where;
            continue;
        }
        ++valid;
        const Place p = place(rig, i % width, i / width, d);
        const double u = std::clamp(p.u, 0.0, right), v = std::clamp(p.v, 0.0, bottom);
        EXPECT_NEAR(map[2 * i], u, p.slack) << where;
        EXPECT_NEAR(map[2 * i + 1], v, p.slack) << where;
        const int x = std::min(static_cast<int>(u), source.width - 2);
        const int y = std::min(static_cast<int>(v), source.height - 2);
        const double a = u - x, b = v - y;
        for (int c = 0; c < source.channels; ++c) {
            const double value =
                (1 - b) * ((1 - a) * source.at(x, y, c) + a * source.at(x + 1, y, c)) +
                b * ((1 - a) * source.at(x, y + 1, c) + a * source.at(x + 1, y + 1, c));
            const double tolerance = range * (2 * p.slack + 1e-6) + allowed<T>();
            EXPECT_NEAR(out.at(i % width, i / width, c), value, tolerance) << where;
        }
    }
    return valid;
}

std::vector<float> some_depth(std::mt19937& random, int count) {
    std::vector<float> depth(count);
    const bool smooth = random() % 2;  // the usual case, and the one that is not
    const double base = uniform(random, 1, 20);
    for (float& d : depth) d = static_cast<float>(smooth ? base : std::exp(uniform(random, -1, 4)));
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    const float odd[] = {0.0f,
                         -0.0f,
                         -2.0f,
                         std::numeric_limits<float>::quiet_NaN(),
                         -std::numeric_limits<float>::quiet_NaN(),
                         kInfinity,
                         -kInfinity,
                         1e-4f,
                         1e-42f,
                         1e30f};
    for (const float value : odd)
        if (random() % 2) depth[random() % depth.size()] = value;
    return depth;
}

// Cameras that hardly look the same way, beside and ahead of each other, of any scale.
Rig any_rig(std::mt19937& random, int width, int height, int source_width, int source_height,
            bool lenses) {
    Rig rig = random_rig(random, width, height, source_width, source_height);
    const double zoom = std::exp(uniform(random, -1, 1));
    rig.source.fx *= zoom;
    rig.source.fy *= zoom;
    switch (random() % 4) {
        case 0: break;
        case 1: rig = turned(rig, {0, 0, uniform(random, -3.1, 3.1)}); break;
        case 2: rig = turned(rig, {uniform(random, -1, 1), uniform(random, -2, 2), 0}); break;
        case 3:  // points on both sides of the source camera's plane, and close to it
            rig.source_from_reference.translation.z() = -uniform(random, 1, 20);
            break;
    }
    if (!lenses) return rig;
    const int bent = 1 + random() % 3;
    if (bent & 1) rig.source.lens = random_lens(random);
    if (bent & 2) rig.reference.lens = random_lens(random);
    if (random() % 2) rig = with_flipped_source(rig);
    return rig;
}

// Side by side, from a source that is coarser than the reference to one four times as fine.
template <class T>
void expect_usual_paths_agree(unsigned seed, const Lens& source_lens = {},
                              const Lens& reference_lens = {}, int channels = 1) {
    on_every_target([&] {
        std::mt19937 random(seed);
        for (const int source_width : {64, 90, 150, 210, 400, 800}) {
            const int width = 193, height = 40, source_height = source_width / 4;
            Rig rig{Pinhole::from_hfov(width, height, 0.8),
                    Pinhole::from_hfov(source_width, source_height, 0.85),
                    {}};
            rig.source_from_reference.translation = {uniform(random, -0.2, 0.2), 0.01, 0.02};
            rig = turned(rig, {0.01, -0.01, 0.02});
            rig.source.lens = source_lens;
            rig.reference.lens = reference_lens;
            const auto source = random_frame<T>(random, source_width, source_height, channels);
            std::vector<float> depth(std::size_t(width) * height);
            for (int i = 0; i < width * height; ++i)  // a slope, and things before it
                depth[i] = i % width % 50 < 20 ? 3.0f : 8.0f + 0.1f * static_cast<float>(i / width);
            EXPECT_GT(expect_by_the_book(rig, source, depth, 1), width * height / 2);
            if (::testing::Test::HasFailure()) return;
        }
    });
}

TEST(RegisterPaths, AgreeOnUsualBytes) { expect_usual_paths_agree<std::uint8_t>(11); }
TEST(RegisterPaths, AgreeOnUsualBytesInColour) {
    expect_usual_paths_agree<std::uint8_t>(18, {}, {}, 3);
}
TEST(RegisterPaths, AgreeOnUsual16Bits) { expect_usual_paths_agree<std::uint16_t>(12); }
TEST(RegisterPaths, AgreeOnUsualFloats) { expect_usual_paths_agree<float>(13); }

const Lens kBrown(LensModel::brown, {-0.3, 0.1, 0.002, -0.003, 0.01});
const Lens kRational(LensModel::brown, {0.2, 0.1, 0.002, -0.003, 0.01, 0.5, 0.1, 0.02});
const Lens kFisheye(LensModel::fisheye, {0.02, -0.01, 0.002, 0.001});

TEST(RegisterPaths, AgreeOnUsualBytesThroughLenses) {
    expect_usual_paths_agree<std::uint8_t>(11, kBrown);
    expect_usual_paths_agree<std::uint8_t>(12, kRational, kBrown);
    expect_usual_paths_agree<std::uint8_t>(13, {}, kFisheye);
    expect_usual_paths_agree<std::uint8_t>(19, kBrown, {}, 3);
}
TEST(RegisterPaths, AgreeOnUsual16BitsThroughLenses) {
    expect_usual_paths_agree<std::uint16_t>(14, kRational);
    expect_usual_paths_agree<std::uint16_t>(15, kFisheye, kBrown);
}
TEST(RegisterPaths, AgreeOnUsualFloatsThroughLenses) {
    expect_usual_paths_agree<float>(16, kFisheye);
    expect_usual_paths_agree<float>(17, kBrown, kRational);
}

// What lies on whole pixels is not interpolated, by no path.
TEST(RegisterPaths, OneCameraTwiceGivesTheSource) {
    on_every_target([] {
        std::mt19937 random(14);
        const Pinhole camera = Pinhole::from_hfov(200, 30, 0.8);
        const auto source = random_frame<std::uint8_t>(random, 200, 30, 1);
        const Image depth(200, 30, 4.0f);
        Frame<std::uint8_t> out(200, 30, 1);
        std::vector<std::uint8_t> mask(200 * 30, 9);
        Registrar(Rig{camera, camera, {}}, RegistrarOptions{1})
            .register_frame(source.view(), depth.view(), out.mutable_view(), mask.data());
        int different = 0;
        for (std::size_t i = 0; i < mask.size(); ++i)
            different += std::abs(int(out.values[i]) - int(source.values[i])) > 1;
        EXPECT_EQ(different, 0);
        EXPECT_EQ(mask, std::vector<std::uint8_t>(200 * 30, 0));
    });
}

template <class T>
void expect_every_path_agrees(unsigned seed, int channels, bool lenses = false) {
    on_every_target([&] {
        std::mt19937 random(seed);
        int valid = 0;
        for (const int width : {1, 2, 3, 7, 8, 9, 15, 16, 17, 31, 33, 63, 64, 65, 100})
            for (const auto& [source_width, source_height] : {std::pair{2, 2},
                                                              {3, 2},
                                                              {9, 11},
                                                              {16, 5},
                                                              {17, 18},
                                                              {40, 30},
                                                              {129, 64},
                                                              {300, 20}}) {
                const int height = 1 + static_cast<int>(random() % 9);
                const Rig rig = any_rig(random, width, height, source_width, source_height, lenses);
                const auto source = random_frame<T>(random, source_width, source_height, channels);
                const std::vector<float> depth = some_depth(random, width * height);
                valid += expect_by_the_book(rig, source, depth, 1);
                std::vector<std::uint16_t> units(depth.size());
                for (std::uint16_t& d : units) d = static_cast<std::uint16_t>(random() % 5000);
                valid += expect_by_the_book(rig, source, units, 1.0 / 256);
                if (::testing::Test::HasFailure()) return;
            }
        EXPECT_GT(valid, 1000);
    });
}

TEST(RegisterPaths, AgreeOnBytes) { expect_every_path_agrees<std::uint8_t>(1, 1); }
TEST(RegisterPaths, AgreeOnBytesInColour) { expect_every_path_agrees<std::uint8_t>(2, 3); }
TEST(RegisterPaths, AgreeOn16Bits) { expect_every_path_agrees<std::uint16_t>(3, 1); }
TEST(RegisterPaths, AgreeOn16BitsInColour) { expect_every_path_agrees<std::uint16_t>(4, 3); }
TEST(RegisterPaths, AgreeOnFloats) { expect_every_path_agrees<float>(5, 1); }
TEST(RegisterPaths, AgreeOnFloatsInColour) { expect_every_path_agrees<float>(6, 3); }

TEST(RegisterPaths, AgreeThroughLenses) {
    expect_every_path_agrees<std::uint8_t>(21, 1, true);
    expect_every_path_agrees<std::uint16_t>(22, 3, true);
    expect_every_path_agrees<float>(23, 1, true);
}

// Memory that ends, or begins, where a page begins, or ends, that may not be touched: of a gather
// that goes beyond, the address sanitizer sees nothing.
class Fenced {
   public:
    Fenced(std::size_t size, bool at_end) {
        const std::size_t page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
        const std::size_t room = (size + page - 1) / page * page;
        length_ = room + 2 * page;
        memory_ = static_cast<char*>(
            mmap(nullptr, length_, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0));
        mprotect(memory_ + page, room, PROT_READ | PROT_WRITE);
        data = memory_ + page + (at_end ? room - size : 0);
    }
    ~Fenced() { munmap(memory_, length_); }
    Fenced(const Fenced&) = delete;
    Fenced& operator=(const Fenced&) = delete;

    char* data;

   private:
    char* memory_;
    std::size_t length_;
};

template <class T>
void expect_nothing_beside_is_touched(unsigned seed) {
    on_every_target([&] {
        std::mt19937 random(seed);
        const auto fenced = [&](std::ptrdiff_t size) {
            return std::make_unique<Fenced>(size, random() % 3 != 0);
        };
        for (int i = 0; i < 400; ++i) {
            const int width = 1 + random() % 70, height = 1 + random() % 9;
            const int source_width = 2 + random() % (i % 2 ? 5 : i % 4 ? 40 : 150);
            const int source_height = 2 + random() % 20, channels = i % 3 ? 1 : 3;
            const Rig rig = any_rig(random, width, height, source_width, source_height, i % 2);
            const std::ptrdiff_t pixel = std::ptrdiff_t(sizeof(T)) * channels;
            const std::ptrdiff_t row = pixel * source_width + (i % 4 ? 0 : 3 * sizeof(T));
            // Nothing follows the last pixel of the last row.
            const auto source = fenced(row * (source_height - 1) + pixel * source_width);
            const auto depth = fenced(4 * width * height), map = fenced(8 * width * height);
            const auto out = fenced(pixel * width * height), mask = fenced(width * height);
            const std::vector<float> values = some_depth(random, width * height);
            std::copy(values.begin(), values.end(), reinterpret_cast<float*>(depth->data));
            const bool flipped = random() % 2;
            const ImageView view{source->data + (flipped ? row * (source_height - 1) : 0),
                                 source_width,
                                 source_height,
                                 channels,
                                 type_of<T>(),
                                 flipped ? -row : row};
            RegistrarOptions options;
            options.num_threads = 1;
            options.nearest = random() % 4 == 0;
            const Registrar registrar(rig, options);
            const ImageView depth_view{depth->data, width, height, 1, PixelType::f32, 4 * width};
            registrar.register_frame(
                view, depth_view, {out->data, width, height, channels, type_of<T>(), pixel * width},
                reinterpret_cast<std::uint8_t*>(mask->data));
            registrar.map(depth_view, reinterpret_cast<float*>(map->data));
        }
    });
}

TEST(RegisterPaths, TouchNothingBesideTheImages) {
    expect_nothing_beside_is_touched<std::uint8_t>(8);
    expect_nothing_beside_is_touched<std::uint16_t>(9);
    expect_nothing_beside_is_touched<float>(10);
}

TEST(RegisterPaths, RowsOfTheSourceMayLieAnyWay) {
    on_every_target([] {
        std::mt19937 random(7);
        const Rig rig = random_rig(random, 64, 48, 50, 40);
        const auto source = random_frame<std::uint8_t>(random, 50, 40, 1);
        std::vector<std::uint8_t> upside_down(source.values.size());
        for (int y = 0; y < 40; ++y)
            std::copy_n(source.values.data() + 50 * y, 50, upside_down.data() + 50 * (39 - y));
        const Image depth(64, 48, 5.0f);
        Frame<std::uint8_t> expected(64, 48, 1), found(64, 48, 1);
        std::vector<std::uint8_t> mask(64 * 48), other_mask(mask);
        const Registrar registrar(rig, RegistrarOptions{1});
        registrar.register_frame(source.view(), depth.view(), expected.mutable_view(), mask.data());
        const ImageView flipped{upside_down.data() + 50 * 39, 50, 40, 1, PixelType::u8, -50};
        registrar.register_frame(flipped, depth.view(), found.mutable_view(), other_mask.data());
        EXPECT_EQ(found.values, expected.values);
        EXPECT_EQ(other_mask, mask);
    });
}

// Beyond what the kernel's integers hold: those of points in the millions are nonsense, and must
// not be taken for a place.
TEST(RegisterPaths, WhatLiesMillionsOfPixelsAwayIsOutside) {
    on_every_target([] {
        const Frame<std::uint8_t> source(64, 48, 1);
        const Image depth(40, 30, 1.0f);
        for (const double away : {4.2e6, 1.3e7, 2e7, 2.516e7, 3e7, 1e9, 1e15, 1e30})
            for (const auto& [dx, dy] : {std::pair{away, 0.0}, {-away, 0.0}, {0.0, -away}}) {
                Rig rig{Pinhole::from_hfov(40, 30, 1.0), Pinhole::from_hfov(64, 48, 1.0), {}};
                rig.source.cx += dx;
                rig.source.cy += dy;
                Frame<std::uint8_t> out(40, 30, 1);
                std::vector<std::uint8_t> mask(40 * 30, 9);
                Registrar(rig, RegistrarOptions{1})
                    .register_frame(source.view(), depth.view(), out.mutable_view(), mask.data());
                EXPECT_EQ(mask, std::vector<std::uint8_t>(40 * 30, 1)) << dx << ", " << dy;
            }
    });
}

}  // namespace
}  // namespace xcalib

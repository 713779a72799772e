// Depth of any size as rows of the reference's grid, against the rule pixel by pixel in double.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <type_traits>
#include <vector>

#include "every_target.hpp"
#include "images/depth_rows.hpp"
#include "views.hpp"
#include "xcalib/register.hpp"

namespace xcalib {
namespace {

using namespace ::xcalib::testing;  // NOLINT: every_target.hpp, views.hpp

constexpr double kSame = 1.1;

bool known(double depth) { return depth > 0 && std::isfinite(depth); }

// What a pixel of the grid must be, and whether a rounding may decide otherwise.
struct Expected {
    double depth = 0;
    bool close_call = false;
};

struct Grid {
    std::vector<double> metres;
    int width, height;
    double at(int x, int y) const {
        const double d = metres[static_cast<std::size_t>(y) * width + x];
        return known(d) ? d : 0;
    }
};

bool is_close(double a, double b) { return std::abs(a - b) < 1e-5 * std::max(a, b); }

Expected grown(const Grid& grid, double x, double y) {
    const auto within = [](double value, int size) {
        return std::clamp(static_cast<int>(std::floor(value)), 0, size - 1);
    };
    const int left = within(x, grid.width), top = within(y, grid.height);
    const int right = std::min(left + 1, grid.width - 1);
    const int bottom = std::min(top + 1, grid.height - 1);
    const double a = std::clamp(x - left, 0.0, 1.0), b = std::clamp(y - top, 0.0, 1.0);
    const double near = grid.at(a < 0.5 ? left : right, b < 0.5 ? top : bottom);
    // Halfway the nearest is either.
    Expected out{near, std::abs(a - 0.5) < 1e-6 || std::abs(b - 0.5) < 1e-6};
    const double d[] = {grid.at(left, top), grid.at(right, top), grid.at(left, bottom),
                        grid.at(right, bottom)};
    const auto [least, most] = std::minmax({d[0], d[1], d[2], d[3]});
    if (near == 0 || least == 0) return out;
    out.close_call |= is_close(most, near * kSame) || is_close(least * kSame, near);
    if (most > near * kSame || least * kSame < near) return out;
    out.depth = 1 / ((1 - b) * ((1 - a) / d[0] + a / d[1]) + b * ((1 - a) / d[2] + a / d[3]));
    return out;
}

Expected reduced(const Grid& grid, double left, double right, double top, double bottom) {
    const auto first = [](double value) { return static_cast<int>(std::floor(value + 0.5)); };
    std::vector<double> values;
    int cells = 0;
    for (int y = first(top); y < std::min(grid.height, std::max(first(top) + 1, first(bottom)));
         ++y)
        for (int x = first(left); x < std::min(grid.width, std::max(first(left) + 1, first(right)));
             ++x, ++cells)
            if (grid.at(x, y) > 0) values.push_back(grid.at(x, y));
    const int count = static_cast<int>(values.size());
    if (count == 0 || 2 * count < cells) return {};
    std::sort(values.begin(), values.end());
    const double median = values[count / 2];
    Expected out{0, is_close(values.back(), values.front() * kSame)};
    double inverse = 0, members = 0;
    const bool one_surface = values.back() < values.front() * kSame;
    for (const double value : values) {
        out.close_call |= is_close(value, median * kSame) || is_close(value * kSame, median);
        if (!one_surface && (value >= median * kSame || value * kSame <= median)) continue;
        inverse += 1 / value;
        ++members;
    }
    out.depth = members / inverse;
    return out;
}

Expected expected(const Grid& grid, int x, int y, int width, int height) {
    const double sx = static_cast<double>(grid.width) / width;
    const double sy = static_cast<double>(grid.height) / height;
    if (sx > 1 && sy > 1) return reduced(grid, x * sx, (x + 1) * sx, y * sy, (y + 1) * sy);
    return grown(grid, (x + 0.5) * sx - 0.5, (y + 0.5) * sy - 0.5);
}

// Surfaces that slope a little and a lot, steps between them, and what is no depth.
template <class T>
std::vector<T> some_depth(std::mt19937& random, int width, int height, double scale) {
    std::vector<T> out(static_cast<std::size_t>(width) * height);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            double depth = 3 + 0.02 * x + 0.01 * y;
            if (x % 37 > 25) depth = 1.5 + 0.3 * (x % 37 - 25);
            if (y % 23 > 17) depth *= 0.97;
            if (random() % 29 == 0) depth = random() % 2 ? 0 : 40;
            out[static_cast<std::size_t>(y) * width + x] = static_cast<T>(depth / scale);
        }
    if constexpr (std::is_floating_point_v<T>)
        for (const float odd : {-0.0f, -2.0f, kNaN, -kNaN, kInfinity, -kInfinity, 1e-4f, 1e30f})
            out[random() % out.size()] = odd;
    return out;
}

// Returns how many pixels were of depths that differ, so that a rule had to decide.
template <class T>
int expect_by_the_rule(std::mt19937& random, const Size& from, const Size& to, double scale) {
    const auto depth = some_depth<T>(random, from.width, from.height, scale);
    Grid grid{{}, from.width, from.height};
    for (const T value : depth)
        grid.metres.push_back(
            static_cast<double>(static_cast<float>(scale) * static_cast<float>(value)));
    DepthRows rows;
    DepthRows::Room room;
    rows.set({view_of(depth, from.width, from.height), static_cast<float>(scale)}, to.width,
             to.height);
    rows.prepare(room);
    int known_pixels = 0, wrong = 0;
    for (int y = 0; y < to.height; ++y) {
        const float* row = rows.row(y, room);
        for (int x = 0; x < to.width; ++x) {
            const Expected e = expected(grid, x, y, to.width, to.height);
            known_pixels += e.depth > 0;
            if (e.close_call) continue;
            wrong += !(std::abs(row[x] - e.depth) <= 1e-6 * e.depth);
            if (wrong > 3) break;
            EXPECT_NEAR(row[x], e.depth, 1e-6 * e.depth)
                << x << ", " << y << " of " << to.width << "x" << to.height << " from "
                << from.width << "x" << from.height;
        }
    }
    return known_pixels;
}

TEST(DepthRows, FollowTheRuleOnEveryTarget) {
    on_every_target([] {
        std::mt19937 random(1);
        for (const auto& [from, to] : {std::pair{Size{80, 60}, Size{160, 120}},
                                       {Size{61, 46}, Size{160, 120}},
                                       {Size{40, 30}, Size{160, 120}},
                                       {Size{159, 120}, Size{160, 120}},
                                       {Size{160, 119}, Size{159, 120}},
                                       {Size{7, 5}, Size{160, 117}},
                                       {Size{1, 1}, Size{33, 20}},
                                       {Size{160, 120}, Size{80, 60}},
                                       {Size{160, 120}, Size{61, 46}},
                                       {Size{160, 120}, Size{150, 113}},
                                       {Size{320, 240}, Size{30, 22}},
                                       {Size{160, 120}, Size{1, 1}}}) {
            EXPECT_GT(expect_by_the_rule<float>(random, from, to, 1), to.width * to.height / 2);
            EXPECT_GT(expect_by_the_rule<std::uint16_t>(random, from, to, 1 / 256.0),
                      to.width * to.height / 2);
        }
    });
}

// The registrar takes the rows that resize_depth makes an image of, whatever thread asks for them.
TEST(DepthRows, TheRegistrarSeesResizedDepth) {
    Rig rig{Pinhole::from_hfov(161, 120, 0.9), Pinhole::from_hfov(80, 64, 0.9), {}};
    rig.source_from_reference.translation = {-0.3, 0.01, 0.02};
    std::mt19937 random(2);
    std::vector<float> source(80 * 64);
    for (float& value : source) value = static_cast<float>(random() % 256);
    struct Frame {
        std::vector<float> image = std::vector<float>(161 * 120);
        std::vector<std::uint8_t> mask = std::vector<std::uint8_t>(161 * 120);
        std::vector<float> map = std::vector<float>(2 * 161 * 120);
    };
    const auto registered = [&](const Registrar& registrar, const ImageView& depth) {
        Frame out;
        registrar.register_frame(view_of(source, 80, 64), depth,
                                 {out.image.data(), 161, 120, 1, PixelType::f32, 4 * 161},
                                 out.mask.data());
        registrar.map(depth, out.map.data());
        for (float& value : out.map)
            if (std::isnan(value)) value = -1;
        return out;
    };
    on_every_target([&] {
        for (const int threads : {1, 3}) {
            const Registrar registrar(rig, {threads, false, Occlusion::hide, 0});
            for (const Size& size : {Size{80, 60}, Size{53, 40}, Size{322, 240}, Size{80, 60}}) {
                // Other frames of the same size: nothing of the one before stays.
                for (int i = 0; i < 2; ++i) {
                    Image depth(size.width, size.height);
                    depth.pixels = some_depth<float>(random, size.width, size.height, 1);
                    const Frame found = registered(registrar, depth.view());
                    const Image full = resize_depth(clean_depth(depth.view()), 161, 120);
                    const Frame wanted = registered(registrar, full.view());
                    EXPECT_EQ(found.mask, wanted.mask);
                    EXPECT_EQ(found.image, wanted.image);
                    EXPECT_EQ(found.map, wanted.map);
                    EXPECT_GT(std::count(found.mask.begin(), found.mask.end(), 0), 161 * 120 / 3);
                }
            }
        }
    });
}

}  // namespace
}  // namespace xcalib

// The C interface against the C++ one, and what it refuses.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <memory>
#include <thread>
#include <vector>

#include "refusal.hpp"
#include "xcalib.h"
#include "xcalib/register.hpp"

namespace xcalib {
namespace {

using ::xcalib::testing::has;

constexpr int kWidth = 61, kHeight = 40, kSourceWidth = 50, kSourceHeight = 32;

xcalib_rig some_rig() {
    return {{kWidth, kHeight, 55, 56, 30.2, 19.8, 0.1, XCALIB_LENS_BROWN, {-0.1, 0.02, 0.001}},
            {kSourceWidth, kSourceHeight, 45, 44, 24.4, 15.3, -0.2, XCALIB_LENS_FISHEYE, {0.01}},
            {0.9998000066665778, 0.0, 0.019998666693333084, 0.0},
            {-0.13, 0.01, 0.02},
            0,
            0,
            0};
}

Rig the_same_rig() {
    const xcalib_rig r = some_rig();
    const auto camera = [](const xcalib_camera& c) {
        const double* k = c.lens_coefficients;
        const Lens lens = c.lens == XCALIB_LENS_BROWN ? Lens(LensModel::brown, {k, k + 8})
                                                      : Lens(LensModel::fisheye, {k, k + 4});
        return Pinhole{c.width, c.height, c.fx, c.fy, c.cx, c.cy, c.skew, lens};
    };
    const double* q = r.quaternion_wxyz;
    const double* t = r.translation_m;
    return {camera(r.reference),
            camera(r.source),
            {Eigen::Quaterniond(q[0], q[1], q[2], q[3]), Eigen::Vector3d(t[0], t[1], t[2])}};
}

struct Destroy {
    void operator()(xcalib_registrar* registrar) const { xcalib_destroy(registrar); }
};
using Handle = std::unique_ptr<xcalib_registrar, Destroy>;

Handle created(const xcalib_options& options) {
    const xcalib_rig rig = some_rig();
    xcalib_registrar* registrar = nullptr;
    EXPECT_EQ(xcalib_create(&rig, &options, &registrar), XCALIB_OK) << xcalib_last_error();
    return Handle(registrar);
}

// A near block before a far wall, a corner of which is unknown.
template <class T>
std::vector<T> some_depth(double per_metre) {
    std::vector<T> depth(kWidth * kHeight, static_cast<T>(8 * per_metre));
    for (int y = 8; y < 30; ++y)
        for (int x = 20; x < 36; ++x) depth[y * kWidth + x] = static_cast<T>(2 * per_metre);
    for (int x = 0; x < 5; ++x) depth[x] = 0;
    return depth;
}

// Registers the same frame through both, into rows with a gap between them.
template <class T, class Depth>
void expect_the_same(PixelType type, PixelType depth_type, int channels,
                     const xcalib_options& options) {
    constexpr int kGap = 3;
    std::vector<T> source(kSourceWidth * kSourceHeight * channels);
    for (std::size_t i = 0; i < source.size(); ++i) source[i] = static_cast<T>(i * 7919 % 251);
    const std::vector<Depth> depth = some_depth<Depth>(depth_type == PixelType::f32 ? 1 : 256);
    const std::ptrdiff_t row = (kWidth * channels + kGap) * sizeof(T);
    std::vector<T> expected((kWidth * channels + kGap) * kHeight, 77), found = expected;
    std::vector<std::uint8_t> expected_mask(kWidth * kHeight, 9), found_mask = expected_mask;
    std::vector<float> expected_map(2 * kWidth * kHeight), found_map = expected_map;
    const ImageView source_view{source.data(), kSourceWidth,
                                kSourceHeight, channels,
                                type,          std::ptrdiff_t(sizeof(T)) * kSourceWidth * channels};
    const ImageView depth_view{
        depth.data(), kWidth, kHeight, 1, depth_type, std::ptrdiff_t(sizeof(Depth)) * kWidth};
    const auto in_c = [](const ImageView& view) {
        return xcalib_image{
            view.data,     view.width, view.height, view.channels, static_cast<int>(view.type),
            view.row_bytes};
    };

    const Registrar registrar(the_same_rig(),
                              {options.num_threads, options.nearest != 0,
                               static_cast<Occlusion>(options.occlusion), options.depth_scale});
    registrar.register_frame(source_view, depth_view,
                             {expected.data(), kWidth, kHeight, channels, type, row},
                             expected_mask.data());
    registrar.map(depth_view, expected_map.data());

    const Handle handle = created(options);
    const xcalib_image c_source = in_c(source_view), c_depth = in_c(depth_view);
    const xcalib_output output{found.data(),           kWidth, kHeight, channels,
                               static_cast<int>(type), row};
    EXPECT_EQ(xcalib_register(handle.get(), &c_source, &c_depth, &output, found_mask.data()),
              XCALIB_OK)
        << xcalib_last_error();
    EXPECT_EQ(xcalib_map(handle.get(), &c_depth, found_map.data()), XCALIB_OK);
    EXPECT_EQ(found, expected);
    EXPECT_EQ(found_mask, expected_mask);
    EXPECT_EQ(std::memcmp(found_map.data(), expected_map.data(), 4 * found_map.size()), 0);
    EXPECT_EQ(found[kWidth * channels], 77) << "a gap between rows";
    EXPECT_EQ(found_mask[0], XCALIB_NO_DEPTH);
    EXPECT_GT(std::count(found_mask.begin(), found_mask.end(), XCALIB_VALID), kWidth * kHeight / 3);
    EXPECT_EQ(std::count(found_mask.begin(), found_mask.end(), XCALIB_OCCLUDED) > 0,
              options.occlusion != XCALIB_OCCLUSION_IGNORE);
}

TEST(CApi, DoesAsTheRegistrarDoes) {
    for (const int channels : {1, 3})
        for (const auto occlusion :
             {XCALIB_OCCLUSION_IGNORE, XCALIB_OCCLUSION_MARK, XCALIB_OCCLUSION_HIDE})
            for (const int nearest : {0, 1}) {
                const xcalib_options options{2, nearest, occlusion, 1.0 / 256};
                expect_the_same<std::uint8_t, float>(PixelType::u8, PixelType::f32, channels,
                                                     options);
                expect_the_same<std::uint16_t, std::uint16_t>(PixelType::u16, PixelType::u16,
                                                              channels, options);
                expect_the_same<float, float>(PixelType::f32, PixelType::f32, channels, options);
            }
}

TEST(CApi, DefaultOptionsAreTheRegistrars) {
    const xcalib_options options = xcalib_default_options();
    EXPECT_EQ(options.num_threads, 0);
    EXPECT_EQ(options.nearest, 0);
    EXPECT_EQ(options.occlusion, XCALIB_OCCLUSION_MARK);
    EXPECT_EQ(options.depth_scale, 0);
    const xcalib_rig rig = some_rig();
    xcalib_registrar* registrar = nullptr;
    EXPECT_EQ(xcalib_create(&rig, nullptr, &registrar), XCALIB_OK);
    xcalib_destroy(registrar);
    xcalib_destroy(nullptr);
}

TEST(CApi, VersionIsOfThreeNumbers) {
    int major = -1, minor = -1, patch = -1;
    EXPECT_EQ(std::sscanf(xcalib_version(), "%d.%d.%d", &major, &minor, &patch), 3);
}

TEST(CApi, RefusesARigOrOptionsThatAreNotValid) {
    xcalib_registrar* registrar = reinterpret_cast<xcalib_registrar*>(1);
    xcalib_rig rig = some_rig();
    rig.source.fx = -45;
    EXPECT_EQ(xcalib_create(&rig, nullptr, &registrar), XCALIB_INVALID_ARGUMENT);
    EXPECT_EQ(registrar, nullptr);
    EXPECT_TRUE(has(xcalib_last_error(), "source: fx = -45, expected"));
    rig = some_rig();
    rig.quaternion_wxyz[0] = 0;
    EXPECT_EQ(xcalib_create(&rig, nullptr, &registrar), XCALIB_INVALID_ARGUMENT);
    EXPECT_TRUE(has(xcalib_last_error(), "quaternion"));
    rig = some_rig();
    xcalib_options options = xcalib_default_options();
    options.occlusion = 7;
    EXPECT_EQ(xcalib_create(&rig, &options, &registrar), XCALIB_INVALID_ARGUMENT);
    EXPECT_TRUE(has(xcalib_last_error(), "occlusion is 7"));
    options = xcalib_default_options();
    options.num_threads = -2;
    EXPECT_EQ(xcalib_create(&rig, &options, &registrar), XCALIB_INVALID_ARGUMENT);
    EXPECT_TRUE(has(xcalib_last_error(), "num_threads is -2"));
    EXPECT_EQ(xcalib_create(nullptr, nullptr, &registrar), XCALIB_INVALID_ARGUMENT);
    EXPECT_STREQ(xcalib_last_error(), "rig is NULL");
    EXPECT_EQ(xcalib_create(&rig, nullptr, nullptr), XCALIB_INVALID_ARGUMENT);
    EXPECT_STREQ(xcalib_last_error(), "registrar is NULL");
}

TEST(CApi, RefusesALensThatIsNone) {
    const auto refused = [](int model, double coefficient) {
        xcalib_rig rig = some_rig();
        rig.source.lens = model;
        rig.source.lens_coefficients[1] = coefficient;
        xcalib_registrar* registrar = nullptr;
        EXPECT_EQ(xcalib_create(&rig, nullptr, &registrar), XCALIB_INVALID_ARGUMENT);
        EXPECT_EQ(registrar, nullptr);
        return std::string(xcalib_last_error());
    };
    EXPECT_EQ(refused(3, 0), "source: lens is 3, expected an xcalib_lens_model");
    EXPECT_EQ(refused(XCALIB_LENS_BROWN, INFINITY),
              "source: lens k2 = inf, expected a finite number");
}

TEST(CApi, RefusesImagesThatDoNotFit) {
    const Handle handle = created(xcalib_default_options());
    std::vector<float> source_values(kSourceWidth * kSourceHeight),
        depth_values(kWidth * kHeight, 5);
    std::vector<float> out_values(kWidth * kHeight);
    std::vector<std::uint8_t> mask(kWidth * kHeight);
    const xcalib_image good_source{source_values.data(), kSourceWidth,    kSourceHeight, 1,
                                   XCALIB_F32,           4 * kSourceWidth};
    const xcalib_image good_depth{depth_values.data(), kWidth, kHeight, 1, XCALIB_F32, 4 * kWidth};
    const xcalib_output good_out{out_values.data(), kWidth, kHeight, 1, XCALIB_F32, 4 * kWidth};
    xcalib_image source = good_source, depth = good_depth;
    xcalib_output out = good_out;
    const auto expect_refused = [&](const std::string& why) {
        EXPECT_EQ(xcalib_register(handle.get(), &source, &depth, &out, mask.data()),
                  XCALIB_INVALID_ARGUMENT)
            << why;
        EXPECT_TRUE(has(xcalib_last_error(), why));
        source = good_source, depth = good_depth, out = good_out;
        EXPECT_EQ(xcalib_register(handle.get(), &source, &depth, &out, mask.data()), XCALIB_OK);
    };
    source.data = nullptr;
    expect_refused("source: data is NULL");
    source.width = 0;
    expect_refused("source: width = 0, expected at least 1 px");
    source.width = kSourceWidth - 1;
    expect_refused("source is 49x32, expected the rig's 50x32");
    source.height = -1;
    expect_refused("source: height = -1");
    source.channels = 2;
    expect_refused("source: channels = 2, expected 1 or 3");
    source.type = -1;
    expect_refused("source: type = -1");
    source.row_bytes = 4 * kSourceWidth - 4;
    expect_refused("source: row_bytes = 196, expected at least");
    source.row_bytes = 4 * kSourceWidth + 2;
    expect_refused("source: row_bytes = 202, expected a multiple");
    source.data = reinterpret_cast<const char*>(source_values.data()) + 1;
    expect_refused("source: data is not aligned");
    depth.type = XCALIB_U16;  // no scale was given
    expect_refused("depth_scale");
    depth.width = kHeight;
    expect_refused("expected the aspect of 61x40");
    out.type = XCALIB_U16;
    expect_refused("registered must have the source's pixel type");
    out.row_bytes = -4;
    expect_refused("registered: row_bytes = -4");

    EXPECT_EQ(xcalib_register(nullptr, &source, &depth, &out, mask.data()),
              XCALIB_INVALID_ARGUMENT);
    EXPECT_STREQ(xcalib_last_error(), "registrar is NULL");
    EXPECT_EQ(xcalib_register(handle.get(), nullptr, &depth, &out, mask.data()),
              XCALIB_INVALID_ARGUMENT);
    EXPECT_STREQ(xcalib_last_error(), "source is NULL");
    EXPECT_EQ(xcalib_register(handle.get(), &source, &depth, nullptr, mask.data()),
              XCALIB_INVALID_ARGUMENT);
    EXPECT_STREQ(xcalib_last_error(), "registered is NULL");
    EXPECT_EQ(xcalib_register(handle.get(), &source, &depth, &out, nullptr),
              XCALIB_INVALID_ARGUMENT);
    EXPECT_STREQ(xcalib_last_error(), "mask is NULL");
    EXPECT_EQ(xcalib_map(handle.get(), &depth, nullptr), XCALIB_INVALID_ARGUMENT);
    EXPECT_STREQ(xcalib_last_error(), "map is NULL");
}

TEST(CApi, EveryThreadHasItsOwnLastError) {
    EXPECT_EQ(xcalib_map(nullptr, nullptr, nullptr), XCALIB_INVALID_ARGUMENT);
    std::string other = "nothing";
    std::thread([&] { other = xcalib_last_error(); }).join();
    EXPECT_EQ(other, "");
    EXPECT_STREQ(xcalib_last_error(), "registrar is NULL");
}

}  // namespace
}  // namespace xcalib

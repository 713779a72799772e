// A program of its own: it counts what operator new is asked for.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>
#include <vector>

#include "xcalib.h"
#include "xcalib/register.hpp"

namespace {
std::atomic<long> allocations{0};

void* counted(std::size_t size) {
    ++allocations;
    if (void* memory = std::malloc(size ? size : 1)) return memory;
    throw std::bad_alloc();
}
}  // namespace

void* operator new(std::size_t size) { return counted(size); }
void* operator new[](std::size_t size) { return counted(size); }
void* operator new(std::size_t size, std::align_val_t alignment) {
    ++allocations;
    const auto to = static_cast<std::size_t>(alignment);
    if (void* memory = std::aligned_alloc(to, (size + to - 1) / to * to)) return memory;
    throw std::bad_alloc();
}
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete[](void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t) noexcept { std::free(memory); }

namespace xcalib {
namespace {

TEST(Registrar, AllocatesNothingForAFrame) {
    Rig rig{Pinhole::from_hfov(321, 240, 0.9), Pinhole::from_hfov(160, 128, 0.9), {}};
    rig.source_from_reference.translation = {-0.3, 0.01, 0.02};
    const std::vector<float> source(160 * 128, 0.5f);
    std::vector<float> depth(321 * 240, 8.0f), out(321 * 240);
    for (int y = 60; y < 150; ++y)
        for (int x = 100; x < 160; ++x) depth[y * 321 + x] = 2.0f;
    std::vector<std::uint8_t> mask(321 * 240);
    std::vector<float> map(2 * 321 * 240);
    for (const int threads : {1, 2, 4})
        for (const Occlusion occlusion : {Occlusion::ignore, Occlusion::hide}) {
            const long none = allocations;
            const Registrar registrar(rig, {threads, false, occlusion, 0});
            EXPECT_GT(allocations, none) << "the count counts";
            const auto frame = [&] {
                registrar.register_frame({source.data(), 160, 128, 1, PixelType::f32, 640},
                                         {depth.data(), 321, 240, 1, PixelType::f32, 1284},
                                         {out.data(), 321, 240, 1, PixelType::f32, 1284},
                                         mask.data());
                registrar.map({depth.data(), 321, 240, 1, PixelType::f32, 1284}, map.data());
            };
            const long before = allocations;
            for (int i = 0; i < 20; ++i) frame();
            EXPECT_EQ(allocations, before)
                << threads << " threads, occlusion " << static_cast<int>(occlusion);
        }
}

TEST(Registrar, AllocatesNothingForDepthOfAnotherSize) {
    Rig rig{Pinhole::from_hfov(320, 240, 0.9), Pinhole::from_hfov(160, 128, 0.9), {}};
    rig.source_from_reference.translation = {-0.3, 0.01, 0.02};
    const std::vector<std::uint8_t> source(160 * 128, 99);
    std::vector<std::uint8_t> out(320 * 240), mask(320 * 240);
    for (const int threads : {1, 4}) {
        const Registrar registrar(rig, {threads, false, Occlusion::mark, 0});
        for (const int width : {640, 160, 130, 330}) {
            const int height = 3 * width / 4;
            std::vector<float> depth(static_cast<std::size_t>(width) * height);
            for (std::size_t i = 0; i < depth.size(); ++i) depth[i] = i % 7 ? 3.0f : 9.0f;
            const auto frame = [&] {
                registrar.register_frame(
                    {source.data(), 160, 128, 1, PixelType::u8, 160},
                    {depth.data(), width, height, 1, PixelType::f32, 4 * width},
                    {out.data(), 320, 240, 1, PixelType::u8, 320}, mask.data());
            };
            frame();  // the first of a size makes room
            const long before = allocations;
            for (int i = 0; i < 10; ++i) frame();
            EXPECT_EQ(allocations, before) << threads << " threads, " << width << "x" << height;
        }
    }
}

TEST(CApi, AllocatesNothingForAFrame) {
    const xcalib_camera camera{321, 240, 300, 300, 160, 119.5, 0, XCALIB_LENS_NONE, {}};
    const xcalib_rig rig{camera, camera, {1, 0, 0, 0}, {-0.3, 0.01, 0.02}, 0, 0, 0};
    xcalib_registrar* registrar = nullptr;
    ASSERT_EQ(xcalib_create(&rig, nullptr, &registrar), XCALIB_OK);
    std::vector<float> pixels(321 * 240, 8.0f), out(321 * 240), map(2 * 321 * 240);
    std::vector<std::uint8_t> mask(321 * 240);
    const xcalib_image image{pixels.data(), 321, 240, 1, XCALIB_F32, 4 * 321};
    const xcalib_output registered{out.data(), 321, 240, 1, XCALIB_F32, 4 * 321};
    const long before = allocations;
    for (int i = 0; i < 20; ++i) {
        ASSERT_EQ(xcalib_register(registrar, &image, &image, &registered, mask.data()), XCALIB_OK);
        ASSERT_EQ(xcalib_map(registrar, &image, map.data()), XCALIB_OK);
    }
    EXPECT_EQ(allocations, before);
    xcalib_destroy(registrar);
}

}  // namespace
}  // namespace xcalib

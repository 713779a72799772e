// The sizes of all public classes, and what a Registrar makes of a frame.
#include <cstdint>
#include <cstdio>
#include <vector>

#include "headers.inc"

using namespace xcalib;  // NOLINT: sizes.inc has bare names

namespace {

constexpr int kWidth = 161, kHeight = 120;

void print_sizes() {
#define SIZE(name) \
    std::printf("sizeof %s: %zu, aligned to %zu\n", #name, sizeof(name), alignof(name));
#include "sizes.inc"
#undef SIZE
}

void print_frame() {
    Rig rig;
    rig.reference = Pinhole::from_hfov(kWidth, kHeight, 0.8);
    rig.source = Pinhole::from_hfov(kWidth, kHeight, 0.7);
    rig.source_from_reference.rotation =
        Eigen::Quaterniond(0.9998, 0.01, -0.015, 0.008).normalized();
    rig.source_from_reference.translation = Eigen::Vector3d(-0.2, 0.05, 0.1);
    std::vector<Registrar> registrars;  // in one row: what is written past one's end is seen
    for (int i = 0; i < 3; ++i) registrars.emplace_back(rig);

    std::vector<std::uint8_t> source(kWidth * kHeight), mask(kWidth * kHeight);
    std::vector<float> depth(kWidth * kHeight), map(2 * kWidth * kHeight);
    for (int i = 0; i < kWidth * kHeight; ++i) {
        source[i] = static_cast<std::uint8_t>(i * 7);
        depth[i] = static_cast<float>(4 + i % kWidth / 40);
    }
    std::vector<std::uint8_t> registered(source.size());
    for (const Registrar& registrar : registrars) {
        const ImageView depths{depth.data(),   kWidth,
                               kHeight,        1,
                               PixelType::f32, kWidth * static_cast<std::ptrdiff_t>(sizeof(float))};
        registrar.map(depths, map.data());
        registrar.register_frame({source.data(), kWidth, kHeight, 1, PixelType::u8, kWidth}, depths,
                                 {registered.data(), kWidth, kHeight, 1, PixelType::u8, kWidth},
                                 mask.data());
        long sum = 0, codes[4] = {};
        for (const std::uint8_t value : registered) sum += value;
        for (const std::uint8_t code : mask) ++codes[code];
        const std::size_t middle = kWidth * (kHeight / 2) + kWidth / 2;
        std::printf("fx %.6f, map %.3f %.3f, sum of values %ld, mask %ld %ld %ld %ld\n",
                    registrar.rig().source.fx, map[2 * middle], map[2 * middle + 1], sum, codes[0],
                    codes[1], codes[2], codes[3]);
    }
}

}  // namespace

int main() {
    print_sizes();
    print_frame();
}

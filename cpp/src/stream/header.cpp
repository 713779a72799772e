#include "xcalib/stream/header.hpp"

#include <array>
#include <cstring>
#include <fstream>

namespace xcalib {
namespace {

using Byte = unsigned char;

template <std::size_t kCount>
bool read(std::ifstream& in, std::array<Byte, kCount>& bytes) {
    return static_cast<bool>(in.read(reinterpret_cast<char*>(bytes.data()), kCount));
}

template <std::size_t kCount>
int big_endian(const std::array<Byte, kCount>& bytes, std::size_t at, int count) {
    unsigned value = 0;
    for (int i = 0; i < count; ++i) value = value << 8 | bytes[at + i];
    return static_cast<int>(value);
}

std::optional<HeaderSize> sane(int width, int height) {
    if (width <= 0 || height <= 0) return std::nullopt;
    return HeaderSize{width, height};
}

// Segment by segment, up to the one of the frame.
std::optional<HeaderSize> jpeg_size(std::ifstream& in) {
    std::array<Byte, 4> segment;  // FF, its kind, its length with that of the length
    for (in.seekg(2); read(in, segment) && segment[0] == 0xff;) {
        const int kind = segment[1];
        // C4, C8 and CC are tables, the others of their kind start a frame.
        if (kind >= 0xc0 && kind <= 0xcf && kind != 0xc4 && kind != 0xc8 && kind != 0xcc) {
            std::array<Byte, 5> frame;  // bits, height, width
            if (!read(in, frame)) return std::nullopt;
            return sane(big_endian(frame, 3, 2), big_endian(frame, 1, 2));
        }
        const int length = big_endian(segment, 2, 2);
        if (kind == 0xda || length < 2) return std::nullopt;
        in.seekg(length - 2, std::ios::cur);
    }
    return std::nullopt;
}

}  // namespace

std::optional<HeaderSize> header_size(const std::filesystem::path& file) {
    std::ifstream in(file, std::ios::binary);
    std::array<Byte, 24> start;
    if (!read(in, start)) return std::nullopt;
    if (std::memcmp(start.data(), "\x89PNG\r\n\x1a\n\0\0\0\rIHDR", 16) == 0)
        return sane(big_endian(start, 16, 4), big_endian(start, 20, 4));
    if (start[0] == 0xff && start[1] == 0xd8) return jpeg_size(in);
    return std::nullopt;
}

}  // namespace xcalib

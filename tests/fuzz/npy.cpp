#include "xcalib/stream/npy.hpp"

#include "fuzzed.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    return xcalib::fuzz::refused_or_read(
        [&] { xcalib::parse_npy(xcalib::fuzz::text_of(data, size), "a.npy"); });
}

#include "xcalib/stream/arrays.hpp"

#include "fuzzed.hpp"
#include "xcalib/stream/npy.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string text = xcalib::fuzz::text_of(data, size);
    return xcalib::fuzz::refused_or_read([&] {
        if (text.rfind("PF", 0) == 0 || text.rfind("Pf", 0) == 0) xcalib::parse_pfm(text, "a.pfm");
        else xcalib::parse_npy(xcalib::npy_of_npz(text, "a.npz"), "a.npz");
    });
}

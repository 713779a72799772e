#include "xcalib/footage/flir.hpp"

#include "fuzzed.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    return xcalib::fuzz::refused_or_read([&] {
        auto parts = xcalib::flir_parts(xcalib::fuzz::text_of(data, size), "a.jpg");
        if (!parts) return;
        if (!parts->is_file) xcalib::put_counts_right(*parts);
        xcalib::flir_alignment(*parts, "a.jpg").validate();
    });
}

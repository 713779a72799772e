#include "depth_stream.hpp"

#include <fcntl.h>

#include "fuzzed.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const auto file = xcalib::fuzz::file_of(xcalib::fuzz::text_of(data, size), "depth");
    const int descriptor = open(file.c_str(), O_RDONLY);
    xcalib::fuzz::refused_or_read([&] {
        xcalib::cli::DepthStream stream(descriptor);
        while (stream.next()) {
        }
    });
    close(descriptor);
    return 0;
}

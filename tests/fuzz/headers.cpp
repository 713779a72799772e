#include "fuzzed.hpp"
#include "xcalib/footage/exif.hpp"
#include "xcalib/stream/header.hpp"
#include "xcalib/stream/tiff.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    std::string text = xcalib::fuzz::text_of(data, size);
    return xcalib::fuzz::refused_or_read([&] {
        xcalib::header_size(xcalib::fuzz::file_of(text, "a.png"));
        xcalib::header_size(xcalib::fuzz::file_of(text, "a.jpg"));
        xcalib::exif_orientation(text);
        xcalib::forget_tiff_orientation(text);
        xcalib::put_as_signed(text);
        xcalib::put_full_page_first(text, "a.tiff");
    });
}

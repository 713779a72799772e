#include "xcalib/rig_file.hpp"

#include "fuzzed.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const auto file = xcalib::fuzz::file_of(xcalib::fuzz::text_of(data, size), "rig.yaml");
    return xcalib::fuzz::refused_or_read([&] {
        const xcalib::Rig rig = xcalib::load_rig(file.string());
        xcalib::implausible(rig);
        // What could be read can be written, and reads back.
        xcalib::save_rig(rig, file.string());
        if (xcalib::load_rig(file.string()).t() != rig.t()) std::abort();
    });
}

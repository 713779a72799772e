#include "fuzzed.hpp"
#include "xcalib/footage/pairing.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string text = xcalib::fuzz::text_of(data, size);
    return xcalib::fuzz::refused_or_read([&] {
        xcalib::times_of_table(text, "t.csv", {"0", "1"});
        xcalib::times_of_names({text, text + "1"});
        xcalib::natural_order({text, "12", text + "3"});
    });
}

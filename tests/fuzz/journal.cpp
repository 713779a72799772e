#include "xcalib/stream/journal.hpp"

#include "fuzzed.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string text = xcalib::fuzz::text_of(data, size);
    for (const bool overwrite : {false, true})
        xcalib::fuzz::refused_or_read([&] {
            const auto file = xcalib::fuzz::file_of(text, "register.jsonl");
            const xcalib::Journal journal(file, {{"command", "xcalib"}}, overwrite);
        });
    return 0;
}

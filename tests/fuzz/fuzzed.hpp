// What the targets share: data as a file, and errors that are expected of it.
#pragma once

#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <system_error>

namespace xcalib::fuzz {

// A file of this process that holds the data, in memory where the system has such a folder.
inline std::filesystem::path file_of(const std::string& data, const std::string& name) {
    static const std::filesystem::path folder = [] {
        const std::filesystem::path memory = "/dev/shm";
        const auto base =
            std::filesystem::is_directory(memory) ? memory : std::filesystem::temp_directory_path();
        const auto own = base / ("xcalib_fuzz_" + std::to_string(getpid()));
        std::filesystem::create_directories(own);
        return own;
    }();
    std::ofstream(folder / name, std::ios::binary) << data;
    return folder / name;
}

// Calls `read`, which may refuse the data in the ways that commands know how to say.
template <class Read>
int refused_or_read(const Read& read) {
    try {
        read();
    } catch (const std::invalid_argument& error) {
        // One line that people can read.
        if (std::string(error.what()).size() > 2000) std::abort();
    } catch (const std::system_error&) {
    }
    return 0;
}

inline std::string text_of(const std::uint8_t* data, std::size_t size) {
    return {reinterpret_cast<const char*>(data), size};
}

}  // namespace xcalib::fuzz

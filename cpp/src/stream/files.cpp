#include "xcalib/stream/files.hpp"

#include <unistd.h>

#include <cerrno>
#include <fstream>
#include <iterator>
#include <system_error>

namespace xcalib {

namespace fs = std::filesystem;

std::string read_file(const fs::path& file) {
    std::ifstream in(file, std::ios::binary);
    if (!in) throw std::system_error(errno, std::generic_category(), file.string());
    std::string data{std::istreambuf_iterator<char>(in), {}};
    if (in.bad()) throw std::system_error(EIO, std::generic_category(), file.string());
    return data;
}

void write_file(const fs::path& file, std::string_view data) {
    if (file.has_parent_path()) fs::create_directories(file.parent_path());
    fs::path partial = file;
    partial.replace_filename("." + file.filename().string() + "." + std::to_string(getpid()) +
                             ".partial");
    {
        std::ofstream out(partial, std::ios::binary);
        out.write(data.data(), static_cast<std::streamsize>(data.size()));
        out.close();
        if (!out) {
            const int code = errno;
            std::error_code ignored;
            fs::remove(partial, ignored);
            throw std::system_error(code, std::generic_category(), file.string());
        }
    }
    fs::rename(partial, file);
}

}  // namespace xcalib

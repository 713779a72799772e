#include "base/read_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>

#include "xcalib/error.hpp"

namespace xcalib {

std::string read_whole(const std::filesystem::path& file, std::uintmax_t most) {
    const auto fail = [&](int code) {
        throw std::system_error(code, std::generic_category(), file.string());
    };
    struct Descriptor {
        const int number;
        ~Descriptor() {
            if (number >= 0) ::close(number);
        }
    } const opened{::open(file.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY)};
    struct stat about {};
    if (opened.number < 0 || fstat(opened.number, &about) != 0) fail(errno);
    if (S_ISDIR(about.st_mode)) fail(EISDIR);
    if (!S_ISREG(about.st_mode))
        throw InputError(file.string() + " is a pipe or a device, expected a file");
    const auto check = [&](std::uintmax_t size) {
        if (size > most)
            throw InputError(file.string() + " has " + std::to_string(size) +
                             " bytes, expected at most " + std::to_string(most));
    };
    check(static_cast<std::uintmax_t>(about.st_size));
    std::string data;
    constexpr std::size_t kChunk = 1 << 16;
    data.resize(static_cast<std::size_t>(about.st_size) + 1);
    for (std::size_t size = 0;;) {
        const ssize_t got = ::read(opened.number, data.data() + size, data.size() - size);
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) fail(errno);
        size += static_cast<std::size_t>(got);
        if (got == 0) {
            data.resize(size);
            return data;
        }
        check(size);
        // It grows as it is read.
        if (size == data.size()) data.resize(size + std::max(kChunk, size / 2));
    }
}

}  // namespace xcalib

#include "base/whole_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cinttypes>
#include <random>
#include <set>
#include <system_error>

#include "base/format.hpp"
#include "xcalib/error.hpp"

namespace xcalib {
namespace {

namespace fs = std::filesystem;
using Path = fs::path;

constexpr const char* kSuffix = ".partial";
constexpr std::size_t kDigits = 16;

[[noreturn]] void fail(int code, const Path& file) {
    throw std::system_error(code, std::generic_category(), file.string());
}

// Names that nobody can have planted something at.
std::string unguessable() {
    std::random_device system;
    return format("%08" PRIx32 "%08" PRIx32, static_cast<std::uint32_t>(system()),
                  static_cast<std::uint32_t>(system()));
}

Path folder_of(const Path& file) { return file.has_parent_path() ? file.parent_path() : "."; }

void write_all(int descriptor, std::string_view data, const Path& file) {
    while (!data.empty()) {
        const ssize_t written = ::write(descriptor, data.data(), data.size());
        if (written < 0 && errno == EINTR) continue;
        if (written <= 0) fail(written < 0 ? errno : ENOSPC, file);
        data.remove_prefix(static_cast<std::size_t>(written));
    }
}

// A descriptor that is closed at the end.
class Opened {
   public:
    // `if_no_device`: what ENXIO means, where that is known.
    Opened(const Path& file, int flags, const Path& named, const char* if_no_device = nullptr)
        : descriptor_(::open(file.c_str(), flags | O_CLOEXEC)) {
        if (descriptor_ < 0 && errno == ENXIO && if_no_device)
            throw InputError("cannot write to " + named.string() + ": " + if_no_device);
        if (descriptor_ < 0) fail(errno, named);
    }
    ~Opened() { ::close(descriptor_); }
    Opened(const Opened&) = delete;
    Opened& operator=(const Opened&) = delete;
    operator int() const { return descriptor_; }

   private:
    int descriptor_;
};

void sync_named(const Path& path, const Path& named) {
    const Opened file(path, O_RDONLY, named);
    // File systems that know no such thing say EINVAL, or that they are read-only.
    if (fsync(file) != 0 && errno != EINVAL && errno != EROFS) fail(errno, named);
}

}  // namespace

void sync_to_disk(const Path& path) { sync_named(path, path); }

WholeFile::WholeFile(Path file, const Path& folder) : file_(std::move(file)) {
    const Path where = folder.empty() ? folder_of(file_) : folder;
    const std::string before = "." + file_.filename().string() + ".";
    while (true) {
        partial_ = where / (before + unguessable() + kSuffix);
        const int made =
            ::open(partial_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
        if (made >= 0) {
            ::close(made);
            return;
        }
        if (errno != EEXIST) {
            partial_.clear();
            fail(errno, file_);
        }
    }
}

WholeFile::WholeFile(WholeFile&& other) noexcept
    : file_(std::move(other.file_)), partial_(std::move(other.partial_)) {
    other.partial_.clear();
}

WholeFile::~WholeFile() {
    if (!partial_.empty()) ::unlink(partial_.c_str());
}

void WholeFile::write(std::string_view data) {
    const Opened out(partial_, O_WRONLY | O_TRUNC | O_NOFOLLOW, file_);
    write_all(out, data, file_);
}

void WholeFile::sync() const { sync_named(partial_, file_); }

void WholeFile::rename() {
    if (::rename(partial_.c_str(), file_.c_str()) != 0) fail(errno, file_);
    partial_.clear();
}

void WholeFile::keep() {
    sync();
    rename();
    sync_named(folder_of(file_), file_);
}

void keep_all(std::vector<WholeFile>& files, const std::function<void()>& all_written) {
    for (const WholeFile& file : files) {
        const Opened partial(file.partial_, O_RDONLY, file.file_);
        sync_file_range(partial, 0, 0, SYNC_FILE_RANGE_WRITE);  // begun, not waited for
    }
    for (const WholeFile& file : files) file.sync();
    all_written();
    std::set<Path> folders;
    for (WholeFile& file : files) {
        file.rename();
        folders.insert(folder_of(file.file_));
    }
    for (const Path& folder : folders) sync_to_disk(folder);
}

std::string complete_name(const std::string& partial) {
    const std::string suffix = kSuffix;
    const std::size_t around = 1 + 1 + kDigits + suffix.size();  // .NAME.0123456789abcdef.partial
    if (partial.size() <= around || partial[0] != '.') return "";
    const std::size_t digits = partial.size() - suffix.size() - kDigits;
    if (partial[digits - 1] != '.' || partial.substr(digits + kDigits) != suffix ||
        partial.find_first_not_of("0123456789abcdef", digits) != digits + kDigits)
        return "";
    return partial.substr(1, digits - 2);
}

Destination::Destination(const Path& named) : file(named) {
    const auto refuse = [&](const std::string& why) {
        throw InputError("cannot write to " + (named.empty() ? std::string("''") : named.string()) +
                         ": " + why);
    };
    if (named.empty()) refuse("the name is empty, expected a file name");
    struct stat there {};
    if (stat(named.c_str(), &there) != 0) {
        if (lstat(named.c_str(), &there) == 0)
            refuse("it is a link that leads nowhere, expected a file name");
        if (!named.has_filename()) refuse("that names a folder, expected a file name");
        return;  // new; or unreachable, as will show
    }
    if (S_ISDIR(there.st_mode)) return;
    direct = S_ISCHR(there.st_mode) || S_ISFIFO(there.st_mode);
    if (direct) return;
    if (!S_ISREG(there.st_mode)) refuse("it is a socket or a disk, expected a file name");
    struct stat out {};
    // What the shell has opened as our output is written to, not replaced under it.
    for (const int stream : {STDOUT_FILENO, STDERR_FILENO})
        if (fstat(stream, &out) == 0 && out.st_dev == there.st_dev && out.st_ino == there.st_ino)
            direct = true;
    if (!direct) file = fs::canonical(named);
}

void write_whole(const Path& named, std::string_view data) {
    const Destination to(named);
    if (to.direct) {
        // A pipe that nobody reads is an error at once, not a wait for ever.
        const Opened out(to.file, O_WRONLY | O_APPEND | O_NONBLOCK | O_NOCTTY, named,
                         "nobody reads this pipe");
        if (fcntl(out, F_SETFL, O_APPEND) != 0) fail(errno, named);
        write_all(out, data, named);
        return;
    }
    if (fs::is_directory(to.file)) fail(EISDIR, named);
    WholeFile file(to.file);
    file.write(data);
    file.keep();
}

}  // namespace xcalib

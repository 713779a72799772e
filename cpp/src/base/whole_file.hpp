// Files that are never seen half-written, whatever ends the process or the machine.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "xcalib/export.hpp"

namespace XCALIB_EXPORT xcalib {  // other libraries have it from here

// A file that is written under another name beside its own, and takes that one when it is complete.
// Nothing that stands at either name is opened or followed. All throw std::system_error with the
// name of the file that is to be.
class WholeFile {
   public:
    // Made empty; in `folder` until it is complete, which is on the same file system; by default
    // that of the file.
    explicit WholeFile(std::filesystem::path file, const std::filesystem::path& folder = {});
    ~WholeFile();  // removed, unless it was kept
    WholeFile(WholeFile&& other) noexcept;
    WholeFile& operator=(WholeFile&&) = delete;

    const std::filesystem::path& partial() const { return partial_; }
    void write(std::string_view data);  // all of it, once

    // It is complete: on the disk first, then under its name, then that is on the disk too.
    void keep();

   private:
    friend void keep_all(std::vector<WholeFile>&, const std::function<void()>&);
    void sync() const;
    void rename();

    std::filesystem::path file_, partial_;
};

// The same for many at once, which is faster than one after the other: the disk writes them
// together. `all_written` is called when all are on the disk, before the first takes its name.
void keep_all(
    std::vector<WholeFile>& files, const std::function<void()>& all_written = [] {});

// What the file is called that one of this name was to become; empty if it is not of a WholeFile.
std::string complete_name(const std::string& partial);

// Makes sure that what was written to a file, or into a folder, survives the loss of power.
void sync_to_disk(const std::filesystem::path& path);

// Where a user says that a file is to be written, which may be a link, a pipe or a device.
struct Destination {
    std::filesystem::path file;  // that links lead to
    bool direct = false;         // a pipe or a device: written to as it is, never replaced

    // Throws InputError for what cannot be written as a file: a socket, a disk, a link that leads
    // nowhere, an empty name or one that ends in a slash.
    explicit Destination(const std::filesystem::path& named);
};

// Writes all of a file there; whole or not at all, where it is one.
void write_whole(const std::filesystem::path& named, std::string_view data);

}  // namespace xcalib

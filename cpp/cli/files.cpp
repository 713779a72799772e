#include "files.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "xcalib/error.hpp"
#include "xcalib/footage/pairing.hpp"

namespace xcalib::cli {

namespace fs = std::filesystem;

std::string lower_suffix(const Path& file) {
    std::string suffix = file.extension().string();
    for (char& c : suffix)
        if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    return suffix;
}

bool has_suffix(const Path& file, const std::vector<std::string>& suffixes) {
    return std::find(suffixes.begin(), suffixes.end(), lower_suffix(file)) != suffixes.end();
}

std::vector<Path> in_natural_order(std::vector<Path> files) {
    std::vector<std::string> names;
    for (const Path& file : files) names.push_back(file.string());
    std::vector<Path> sorted;
    for (const int index : natural_order(names))
        sorted.push_back(std::move(files[static_cast<std::size_t>(index)]));
    return sorted;
}

std::vector<Path> list_files(const Path& folder, const std::vector<std::string>& suffixes) {
    std::string kinds;
    for (const std::string& suffix : suffixes)
        kinds += (kinds.empty() ? "" : ", ") + suffix.substr(1);
    if (!fs::exists(folder)) throw InputError(folder.string() + ": no such folder");
    if (!fs::is_directory(folder))
        throw InputError(folder.string() + " is a file, expected a folder of " + kinds + " files");
    std::vector<std::string> names;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
        const std::string name = entry.path().filename().string();
        if (has_suffix(name, suffixes) && name[0] != '.' && entry.is_regular_file())
            names.push_back(name);
    }
    if (names.empty())
        throw InputError(folder.string() + ": empty, expected " + kinds + " files in it");
    std::vector<Path> files;
    for (const int index : natural_order(names))
        files.push_back(folder / names[static_cast<std::size_t>(index)]);
    return files;
}

void check_folder_writable(const Path& folder) {
    Path base = fs::absolute(folder).lexically_normal();
    while (!fs::exists(base) && base.has_parent_path() && base != base.parent_path())
        base = base.parent_path();
    const std::string cannot = "cannot write to " + folder.string() + ": " + base.string();
    if (!fs::is_directory(base)) throw InputError(cannot + " is a file, expected a folder");
    // Only an attempt shows it: access rights say nothing of read-only and special file systems.
    std::string name = (base / ".xcalib-XXXXXX").string();
    const int file = mkstemp(name.data());
    if (file < 0) throw InputError(cannot + ": " + std::strerror(errno));
    close(file);
    unlink(name.c_str());
}

void check_file_writable(const Path& file) {
    if (fs::is_directory(file))
        throw InputError("cannot write " + file.string() +
                         ": it is a folder, expected a file name");
    check_folder_writable(file.has_parent_path() ? file.parent_path() : Path("."));
}

}  // namespace xcalib::cli

#include "xcalib/stream/outputs.hpp"

#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <map>
#include <set>
#include <system_error>

#include "base/whole_file.hpp"
#include "xcalib/error.hpp"
#include "xcalib/stream/files.hpp"
#include "xcalib/stream/sink.hpp"

namespace xcalib {
namespace {

namespace fs = std::filesystem;
using Path = fs::path;

// What a file is, whatever it is called.
using Identity = std::pair<dev_t, ino_t>;

// None where there is no such file.
std::optional<Identity> identity_of(const Path& path) {
    struct stat about {};
    if (stat(path.empty() ? "." : path.c_str(), &about) != 0) return std::nullopt;
    return Identity{about.st_dev, about.st_ino};
}

// Names that are no folder's: someone who gives one expects a file.
bool is_called_like_a_file(const Path& output) {
    static const std::set<std::string> kSuffixes = {
        ".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".npy",  ".exr", ".m4v",
        ".mov", ".mpg", ".mpeg", ".ts",  ".webm", ".wmv", ".yaml", ".yml", ".json"};
    return output.has_filename() && kSuffixes.count(lower_suffix(output));
}

// Images and depth maps: what a folder may be given for.
bool is_image(const Path& file) {
    static const std::set<std::string> kSuffixes = {".png", ".jpg", ".jpeg", ".tif",  ".tiff",
                                                    ".bmp", ".pgm", ".ppm",  ".webp", ".jp2",
                                                    ".npy", ".npz", ".pfm",  ".exr"};
    return kSuffixes.count(lower_suffix(file)) > 0;
}

Path folder_of(const Path& file) { return file.has_parent_path() ? file.parent_path() : "."; }

// Of `-o=out` all behind the letter is the name.
void check_no_equals(const std::string& name) {
    if (name[0] == '=')
        throw InputError("cannot write to " + name + ": expected -o " + name.substr(1) + " (./" +
                         name + " is a name that begins with =)");
}

[[noreturn]] void refuse_folder(const Path& folder) {
    throw InputError("output folder " + folder.string() + " is an input folder, expected another");
}

}  // namespace

void check_folder_writable(const Path& folder) {
    check_no_equals(folder.string());
    if (folder.empty())
        throw InputError("cannot write to '': the name is empty, expected a folder name");
    Path base = fs::absolute(folder).lexically_normal();
    while (!fs::exists(base) && base.has_parent_path() && base != base.parent_path())
        base = base.parent_path();
    const std::string cannot = "cannot write to " + folder.string() + ": " + base.string();
    if (!fs::is_directory(base)) throw InputError(cannot + " is a file, expected a folder");
    // Only an attempt shows it: access rights say nothing of read-only and special file systems.
    try {
        const WholeFile attempt(base / "xcalib");
    } catch (const std::system_error& error) {
        throw InputError(cannot + ": " + error.code().message());
    }
}

void check_file_writable(const Path& file) {
    check_name(file);
    check_no_equals(file.string());
    const Destination to(file);
    if (fs::is_directory(to.file))
        throw InputError("cannot write to " + file.string() +
                         ": it is a folder, expected a file name");
    if (!to.direct) check_folder_writable(folder_of(to.file));
}

void check_output_writable(const Path& output) {
    check_name(output);
    if (is_video_output(output)) {
        check_file_writable(output);
        std::error_code none;
        const bool link = fs::is_symlink(output, none);
        if (link || Destination(output).direct)
            throw InputError("cannot write to " + output.string() + ": it is a " +
                             (link ? "link" : "pipe or a device") +
                             ", expected a video file or a folder");
        return;
    }
    if (is_called_like_a_file(output) && !fs::is_directory(output))
        throw InputError("cannot write to " + output.string() +
                         ": a video is .mp4, .avi or .mkv, a folder has another name; expected"
                         " one of these");
    check_folder_writable(output);
}

void check_apart(const std::vector<std::string>& reads, const Writes& writes) {
    std::map<Identity, std::string> read;
    std::set<Identity> image_folders;
    std::set<std::string> seen, seen_folders;  // each is asked for once: there may be many
    const auto add = [&](const Path& file) {   // is it a folder?
        if (file.empty() || !seen.insert(file.string()).second) return false;
        struct stat about {};
        const bool there = stat(file.c_str(), &about) == 0;
        if (there) read.emplace(Identity{about.st_dev, about.st_ino}, file.string());
        if (const Path folder = folder_of(file);
            is_image(file) && seen_folders.insert(folder.string()).second)
            if (const auto identity = identity_of(folder)) image_folders.insert(*identity);
        return there && S_ISDIR(about.st_mode);
    };
    for (const std::string& name : reads) {
        if (!add(name)) continue;
        std::error_code none;
        for (const fs::directory_entry& entry : fs::directory_iterator(name, none))
            if (entry.is_regular_file(none)) add(entry.path());
    }
    for (const Path& folder : writes.folders) {
        const auto identity = identity_of(folder);
        if (identity && (image_folders.count(*identity) || read.count(*identity)))
            refuse_folder(folder);
    }
    std::map<Identity, std::string> written;
    std::set<std::string> names;
    std::map<std::string, Path> folders;  // that links lead to
    const auto is_named_twice = [&](const Path& file) {
        Path& folder = folders[folder_of(file).string()];
        if (folder.empty()) folder = fs::weakly_canonical(folder_of(file));
        return !names.insert((folder / file.filename()).string()).second;
    };
    for (const std::string& file : writes.files) {
        const auto identity = identity_of(file);
        if (identity && read.count(*identity)) {
            const std::string& input = read[*identity];
            throw InputError(file + " would be overwritten, but is an input" +
                             (input == file ? "" : " (" + input + ")") +
                             "; expected another output");
        }
        // Two that do not exist yet are distinguished by their names.
        const bool twice =
            identity ? !written.emplace(*identity, file).second : is_named_twice(file);
        struct stat about {};
        if (twice && !(stat(file.c_str(), &about) == 0 && S_ISCHR(about.st_mode)))
            throw InputError(file + " would be written twice, expected another name");
    }
}

std::vector<std::string> files_of(const Frames& frames) {
    std::set<std::string> files, folders;
    const auto add = [&](const Path& file) {
        if (files.insert(file.string()).second) folders.insert(folder_of(file).string());
    };
    for (int index = 0; index < frames.size(); ++index) {
        add(frames.references->file(index));
        add(frames.sources->file(index));
        for (const Path& file : frames.depth->files(index)) add(file);
    }
    // Tables of times are read from the folders of images.
    for (const std::string& folder : folders)
        for (const char* table : {"timestamps.csv", "timestamps.txt"})
            files.insert((Path(folder) / table).string());
    return {files.begin(), files.end()};
}

void check_writes(const std::vector<Path>& files, const Frames& frames,
                  const std::vector<Path>& other_reads) {
    std::vector<std::string> names;
    for (const Path& file : files) {
        check_file_writable(file);
        names.push_back(file.string());
    }
    std::vector<std::string> reads = files_of(frames);
    for (const Path& file : other_reads) reads.push_back(file.string());
    check_apart(reads, {names, {}});
}

}  // namespace xcalib

#include "xcalib/footage/fingerprint.hpp"

#include <sys/stat.h>

#include <algorithm>
#include <cinttypes>
#include <cstdint>

#include "base/format.hpp"

namespace xcalib {

namespace fs = std::filesystem;

std::string fingerprint(std::string_view data) {
    // FNV-1a; what it leaves in the low bits alone is spread at the end (the last step of
    // MurmurHash3).
    std::uint64_t hash = 0xcbf29ce484222325;
    for (const char c : data) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3;
    hash = (hash ^ (hash >> 33)) * 0xff51afd7ed558ccd;
    hash = (hash ^ (hash >> 33)) * 0xc4ceb9fe1a85ec53;
    return format("%016" PRIx64, hash ^ (hash >> 33));
}

std::string fingerprint(const Rig& rig) {
    std::string numbers;
    const auto add = [&numbers](double value) { numbers += format("%.17g ", value); };
    for (const Pinhole& camera : {rig.reference, rig.source})
        for (const double value : {double(camera.width), double(camera.height), camera.fx,
                                   camera.fy, camera.cx, camera.cy, camera.skew})
            add(value);
    for (const Pinhole& camera : {rig.reference, rig.source})
        if (camera.lens.model() != LensModel::none) numbers += Lens::word(camera.lens) + " ";
    const Eigen::Quaterniond& q = rig.source_from_reference.rotation;
    for (const double value : {q.w(), q.x(), q.y(), q.z()}) add(value);
    for (const double value : rig.t()) add(value);
    if (rig.source_mirrored) add(1);
    if (rig.relative_depth) {
        add(rig.relative_depth->scale);
        add(rig.relative_depth->shift);
    }
    return fingerprint(numbers);
}

fs::path absolute_path(const fs::path& path) {
    fs::path out;
    for (const fs::path& part : fs::absolute(path))
        if (!part.empty() && part != ".") out /= part;
    return out;
}

std::vector<std::string> file_stamp(const fs::path& path) {
    std::vector<std::string> stamp{absolute_path(path).string()};
    // The standard library's clock of files has an epoch of its own.
    struct stat about {};
    const auto add = [&](const fs::path& file) {
        stamp.push_back(format(
            "%s %jd %jd.%09ld", file.filename().c_str(), static_cast<std::intmax_t>(about.st_size),
            static_cast<std::intmax_t>(about.st_mtim.tv_sec), about.st_mtim.tv_nsec));
    };
    if (stat(path.c_str(), &about) != 0) return {path.string()};
    if (!S_ISDIR(about.st_mode)) {
        add(path);
        return stamp;
    }
    std::error_code error;
    std::vector<fs::path> files;
    for (fs::directory_iterator entry(path, error), end; !error && entry != end;
         entry.increment(error))
        files.push_back(entry->path());
    std::sort(files.begin(), files.end());
    for (const fs::path& file : files) {
        if (error || stat(file.c_str(), &about) != 0) return {path.string()};
        add(file);
    }
    return stamp;
}

}  // namespace xcalib

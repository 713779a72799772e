#include "xcalib/stream/files.hpp"

#include <algorithm>

#include "base/read_file.hpp"
#include "base/whole_file.hpp"
#include "xcalib/error.hpp"
#include "xcalib/footage/pairing.hpp"

namespace xcalib {
namespace {

namespace fs = std::filesystem;

// Whether the bytes are UTF-8: no overlong forms, no surrogates, nothing above U+10FFFF.
bool is_utf8(const std::string& text) {
    for (std::size_t i = 0; i < text.size();) {
        const auto byte = [&](std::size_t at) {
            return at < text.size() ? static_cast<unsigned char>(text[at]) : 0u;
        };
        const unsigned first = byte(i);
        const int more = first < 0x80 ? 0 : first >> 5 == 6 ? 1 : first >> 4 == 14 ? 2 : 3;
        if (more == 3 && first >> 3 != 30) return false;
        unsigned point = more ? first & (0x3fu >> more) : first;
        for (int k = 1; k <= more; ++k) {
            if (byte(i + k) >> 6 != 2) return false;
            point = point << 6 | (byte(i + k) & 0x3f);
        }
        constexpr unsigned kLeast[] = {0, 0x80, 0x800, 0x10000};
        if (point < kLeast[more] || point > 0x10ffff || point >> 11 == 0x1b) return false;
        i += 1 + static_cast<std::size_t>(more);
    }
    return true;
}

// With `?` in place of what is not ASCII.
std::string readable(std::string text) {
    for (char& c : text)
        if (static_cast<unsigned char>(c) >= 0x80) c = '?';
    return text;
}

// Whether a name is an address (rtsp://..., also as a path has it, rtsp:/...) or an index of V4L2.
bool is_camera(const std::string& name) {
    const std::size_t letters = name.find_first_not_of("abcdefghijklmnopqrstuvwxyz");
    return name.find_first_not_of("0123456789") == std::string::npos ||
           (letters != std::string::npos && letters > 1 && name.compare(letters, 2, ":/") == 0);
}

}  // namespace

std::string read_file(const fs::path& file, std::uintmax_t most) { return read_whole(file, most); }

void write_file(const fs::path& file, std::string_view data) {
    if (file.has_parent_path()) fs::create_directories(file.parent_path());
    write_whole(file, data);
}

std::vector<fs::path> list_files(const fs::path& folder, const std::vector<std::string>& suffixes) {
    std::string kinds;
    for (const std::string& suffix : suffixes)
        kinds += (kinds.empty() ? "" : ", ") + suffix.substr(1);
    if (!fs::exists(folder))
        throw InputError(folder.string() + ": no such folder" +
                         (is_camera(folder.string())
                              ? "; cameras are read by `xcalib-cli register --live`"
                              : ""));
    if (!fs::is_directory(folder))
        throw InputError(folder.string() + " is a file, expected a folder of " + kinds + " files");
    std::vector<std::string> names;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
        const std::string name = entry.path().filename().string();
        const bool wanted =
            std::find(suffixes.begin(), suffixes.end(), lower_suffix(name)) != suffixes.end();
        // A link that leads nowhere stands for a frame, which cannot be decoded.
        const bool dangles = entry.is_symlink() && !entry.exists();
        if (!wanted || name[0] == '.' || !(entry.is_regular_file() || dangles)) continue;
        check_name(entry.path());
        names.push_back(name);
    }
    if (names.empty())
        throw InputError(folder.string() + ": empty, expected " + kinds + " files in it");
    std::vector<fs::path> files;
    for (const int index : natural_order(names))
        files.push_back(folder / names[static_cast<std::size_t>(index)]);
    return files;
}

std::string lower_suffix(const fs::path& file) {
    std::string suffix = file.extension().string();
    for (char& c : suffix)
        if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    return suffix;
}

void check_name(const fs::path& name) {
    if (!is_utf8(name.string()))
        throw InputError(readable(name.string()) +
                         ": the name is not UTF-8 (? stands for what is not ASCII), expected"
                         " another name");
}

void check_text(const std::string& text, const fs::path& file) {
    if (!is_utf8(text)) throw InputError(file.string() + ": expected text in UTF-8");
}

}  // namespace xcalib

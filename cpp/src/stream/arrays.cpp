#include "xcalib/stream/arrays.hpp"

#include <zlib.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <map>
#include <string_view>
#include <vector>

#include "xcalib/error.hpp"
#include "xcalib/stream/files.hpp"

namespace xcalib {
namespace {

// A zip file as numpy writes them: no encryption, no parts; of over 4 GB only what fits here.
class Zip {
   public:
    struct Entry {
        std::size_t packed = 0, size = 0, header = 0;
        int method = 0;
        std::uint32_t check = 0;
    };

    Zip(const std::string& data, const std::string& name) : data_(data), name_(name) {
        // The directory's end is the last of its kind, before a comment.
        const std::size_t end = data.rfind("PK\5\6");
        if (end == std::string::npos || data.size() - end < 22) throw damaged();
        std::size_t at = number(end + 16, 4);
        for (std::size_t left = number(end + 10, 2); left > 0; --left) {
            if (!has(at, 46) || data.compare(at, 4, "PK\1\2") != 0) throw damaged();
            Entry entry;
            entry.method = static_cast<int>(number(at + 10, 2));
            entry.check = static_cast<std::uint32_t>(number(at + 16, 4));
            entry.packed = number(at + 20, 4);
            entry.size = number(at + 24, 4);
            entry.header = number(at + 42, 4);
            const std::size_t length = number(at + 28, 2);
            if (!has(at + 46, length)) throw damaged();
            entries_[data.substr(at + 46, length)] = entry;
            at += 46 + length + number(at + 30, 2) + number(at + 32, 2);
        }
    }

    const std::map<std::string, Entry>& entries() const { return entries_; }

    std::string content(const Entry& entry) const {
        if (!has(entry.header, 30)) throw damaged();
        const std::size_t start =
            entry.header + 30 + number(entry.header + 26, 2) + number(entry.header + 28, 2);
        if (!has(start, entry.packed)) throw damaged();
        std::string out;
        if (entry.method == 0) out = data_.substr(start, entry.packed);
        else if (entry.method == 8) out = inflated(start, entry);
        else throw damaged();
        const auto sum =
            crc32(0, reinterpret_cast<const Bytef*>(out.data()), static_cast<uInt>(out.size()));
        if (out.size() != entry.size || sum != entry.check) throw damaged();
        return out;
    }

    DecodeError damaged() const {
        return DecodeError(name_ + ": cannot decode, truncated or not a .npz archive");
    }

   private:
    bool has(std::size_t at, std::size_t count) const {
        return at <= data_.size() && data_.size() - at >= count;
    }
    std::size_t number(std::size_t at, int bytes) const {
        if (!has(at, static_cast<std::size_t>(bytes))) throw damaged();
        std::size_t value = 0;
        for (int i = bytes - 1; i >= 0; --i)
            value = value << 8 | static_cast<std::uint8_t>(data_[at + static_cast<std::size_t>(i)]);
        return value;
    }
    std::string inflated(std::size_t start, const Entry& entry) const {
        constexpr std::size_t kMostRatio = 1100;  // of deflate, whatever a header says
        if (entry.size > kMostRatio * entry.packed) throw damaged();
        std::string out(entry.size, '\0');
        z_stream stream{};
        if (inflateInit2(&stream, -MAX_WBITS) != Z_OK) throw std::bad_alloc();
        stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(data_.data() + start));
        stream.avail_in = static_cast<uInt>(entry.packed);
        stream.next_out = reinterpret_cast<Bytef*>(out.data());
        stream.avail_out = static_cast<uInt>(out.size());
        const int done = inflate(&stream, Z_FINISH);
        const std::size_t got = stream.total_out;
        inflateEnd(&stream);
        if (done != Z_STREAM_END || got != entry.size) throw damaged();
        return out;
    }

    const std::string& data_;
    const std::string& name_;
    std::map<std::string, Entry> entries_;
};

}  // namespace

std::string npy_of_npz(const std::string& data, const std::string& name) {
    const Zip zip(data, name);
    if (zip.entries().empty()) throw zip.damaged();
    if (zip.entries().size() == 1) return zip.content(zip.entries().begin()->second);
    for (const char* wanted : {"depth.npy", "disparity.npy", "arr_0.npy"}) {
        const auto found = zip.entries().find(wanted);
        if (found != zip.entries().end()) return zip.content(found->second);
    }
    std::string names;
    for (const auto& [entry, _] : zip.entries())
        names += (names.empty() ? "" : ", ") + entry.substr(0, entry.rfind(".npy"));
    throw InputError(name + ": arrays are " + names + ", expected only one, or one named depth");
}

Picture parse_pfm(const std::string& data, const std::string& name) {
    const DecodeError damaged(name + ": cannot decode, truncated or not a .pfm file");
    // Four words, each ended by one blank: Pf, the sides, and a scale whose sign is the byte order.
    std::vector<std::string> words;
    std::size_t at = 0;
    while (words.size() < 4) {
        const std::size_t end = data.find_first_of(" \n\r\t", at);
        if (end == std::string::npos || end - at > 32) throw damaged;
        if (end > at) words.push_back(data.substr(at, end - at));
        at = end + 1;
    }
    if (words[0] == "PF")
        throw InputError(name + ": three channels, expected one: a .pfm file that begins with Pf");
    const auto side = [&](const std::string& word) {
        if (word.size() > 6 || word.find_first_not_of("0123456789") != std::string::npos)
            throw damaged;
        const int value = std::stoi(word);
        if (value < 1) throw damaged;
        return value;
    };
    if (words[0] != "Pf") throw damaged;
    const int width = side(words[1]), height = side(words[2]);
    const bool big_endian = words[3][0] != '-';
    const std::size_t bytes = std::size_t{4} * static_cast<std::size_t>(width);
    if ((data.size() - at) / bytes < static_cast<std::size_t>(height)) throw damaged;
    MutableImageView pixels;
    Picture picture = new_picture(width, height, 1, PixelType::f32, pixels);
    auto* const out = static_cast<char*>(pixels.data);
    for (int y = 0; y < height; ++y) {
        const std::size_t from = at + bytes * static_cast<std::size_t>(height - 1 - y);
        char* const row = out + bytes * static_cast<std::size_t>(y);
        std::memcpy(row, data.data() + from, bytes);
        if (big_endian)
            for (std::size_t i = 0; i < bytes; i += 4) std::reverse(row + i, row + i + 4);
    }
    return picture;
}

std::optional<Picture> read_array(const std::filesystem::path& file, ArrayKind kind) {
    const std::string suffix = lower_suffix(file), name = file.string();
    if (suffix == ".npy") return parse_npy(read_file(file), name, kind);
    if (suffix == ".npz") return parse_npy(npy_of_npz(read_file(file), name), name, kind);
    if (suffix == ".pfm") return parse_pfm(read_file(file), name);
    return std::nullopt;
}

}  // namespace xcalib

#include "xcalib/footage/exif.hpp"

#include <array>
#include <cstdint>
#include <optional>

namespace xcalib {
namespace {

using namespace std::string_view_literals;

// Numbers of a file, of either order of bytes; 0 behind its end.
struct Bytes {
    std::string_view data;
    bool big = true;

    std::uint32_t number(std::size_t at, std::size_t size) const {
        if (size > data.size() || at > data.size() - size) return 0;
        std::uint32_t value = 0;
        for (std::size_t i = 0; i < size; ++i)
            value = value << 8 | static_cast<std::uint8_t>(data[at + (big ? i : size - 1 - i)]);
        return value;
    }
};

// Where the value stands in a TIFF, which is also what a JPEG or PNG has inside.
struct Place {
    std::size_t at;
    bool big;
};

std::optional<Place> place_in_tiff(std::string_view data) {
    constexpr std::uint32_t kOrientation = 274;
    const bool big = data.substr(0, 4) == "MM\0*"sv;
    if (!big && data.substr(0, 4) != "II*\0"sv) return std::nullopt;
    const Bytes bytes{data, big};
    const std::size_t directory = bytes.number(4, 4);
    const std::size_t count = bytes.number(directory, 2);
    for (std::size_t i = 0; i < count; ++i) {
        const std::size_t entry = directory + 2 + 12 * i;
        if (bytes.number(entry, 2) == kOrientation) return Place{entry + 8, big};
    }
    return std::nullopt;
}

// The TIFF in a JPEG or PNG; empty where there is none.
std::string_view exif_of(std::string_view data) {
    const Bytes bytes{data};
    if (data.substr(0, 2) == "\xff\xd8"sv) {
        for (std::size_t at = 2; at + 4 <= data.size() && data[at] == '\xff';) {
            const std::size_t length = bytes.number(at + 2, 2);
            if (data[at + 1] == '\xda' || length < 2) break;
            if (data[at + 1] == '\xe1' && data.substr(at + 4, 6) == "Exif\0\0"sv)
                return data.substr(at + 10, length > 8 ? length - 8 : 0);
            at += 2 + length;
        }
    } else if (data.substr(0, 8) == "\x89PNG\r\n\x1a\n"sv) {
        for (std::size_t at = 8; at + 12 <= data.size();) {
            const std::size_t length = bytes.number(at, 4);
            if (data.substr(at + 4, 4) == "eXIf"sv) return data.substr(at + 8, length);
            at += 12 + length;
        }
    }
    return {};
}

}  // namespace

int exif_orientation(std::string_view file) {
    const std::string_view inside = exif_of(file);
    const std::string_view tiff = inside.empty() ? file : inside;
    const std::optional<Place> place = place_in_tiff(tiff);
    if (!place) return 1;
    const auto value = static_cast<int>(Bytes{tiff, place->big}.number(place->at, 2));
    return value >= 1 && value <= 8 ? value : 1;
}

std::string orientation_text(int orientation) {
    constexpr std::array kTexts = {
        "is as it is to be seen",
        "is to be mirrored",
        "is to be turned by 180 deg",
        "is to be turned by 180 deg and mirrored",
        "is to be turned by 90 deg clockwise and mirrored",
        "is to be turned by 90 deg clockwise",
        "is to be turned by 270 deg clockwise and mirrored",
        "is to be turned by 270 deg clockwise",
    };
    return kTexts.at(static_cast<std::size_t>(orientation - 1));
}

void forget_tiff_orientation(std::string& file) {
    const std::optional<Place> place = place_in_tiff(file);
    if (!place || place->at + 2 > file.size()) return;
    file[place->at] = place->big ? '\0' : '\1';
    file[place->at + 1] = place->big ? '\1' : '\0';
}

}  // namespace xcalib

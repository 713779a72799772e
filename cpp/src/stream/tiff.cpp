#include "xcalib/stream/tiff.hpp"

#include <cstdint>
#include <set>

#include "xcalib/error.hpp"

namespace xcalib {
namespace {

constexpr unsigned kBitsPerSample = 258, kSampleFormat = 339;
constexpr unsigned kShort = 3;  // the type of a field: 16 bits

// Numbers at places of the data; 0 beyond its end.
class Numbers {
   public:
    Numbers(std::string_view data, bool big) : data_(data), big_(big) {}

    std::uint32_t operator()(std::size_t at, std::size_t size) const {
        if (at > data_.size() || data_.size() - at < size) return 0;
        std::uint32_t value = 0;
        for (std::size_t i = 0; i < size; ++i)
            value |= std::uint32_t{static_cast<std::uint8_t>(data_[at + i])}
                     << (8 * (big_ ? size - 1 - i : i));
        return value;
    }

   private:
    std::string_view data_;
    bool big_;
};

}  // namespace

std::string tiff_pixel_type(std::string_view data) {
    const std::string_view order = data.substr(0, 2);
    if (order != "II" && order != "MM") return "";
    const Numbers number(data, order == "MM");
    if (number(2, 2) != 42) return "";
    const std::size_t page = number(4, 4);
    unsigned bits = 0, format = 1;  // unsigned, unless it says otherwise
    for (std::size_t i = 0; i < number(page, 2); ++i) {
        const std::size_t field = page + 2 + 12 * i;
        const std::uint32_t tag = number(field, 2), count = number(field + 4, 4);
        if ((tag != kBitsPerSample && tag != kSampleFormat) || number(field + 2, 2) != kShort)
            continue;
        // Up to two of 16 bits stand in the field itself; of several, one for each channel.
        const std::uint32_t value = number(count <= 2 ? field + 8 : number(field + 8, 4), 2);
        (tag == kBitsPerSample ? bits : format) = value;
    }
    if (bits < 8 || bits > 64 || format < 1 || format > 3) return "";
    static const char* const kNames[] = {"uint", "int", "float"};
    return kNames[format - 1] + std::to_string(bits);
}

bool put_as_signed(std::string& data) {
    if (tiff_pixel_type(data) != "uint32") return false;
    const bool big = data[0] == 'M';
    const std::size_t page = Numbers(data, big)(4, 4), count = Numbers(data, big)(page, 2);
    const std::size_t end = page + 2 + 12 * count;
    if (data.size() < end + 4) return false;
    const auto text_of = [big](std::uint32_t value, std::size_t size) {
        std::string text(size, '\0');
        for (std::size_t i = 0; i < size; ++i)
            text[big ? size - 1 - i : i] = static_cast<char>(value >> (8 * i) & 0xff);
        return text;
    };
    std::size_t at = page + 2;  // of the field, or of where it is to be: tags rise
    while (at < end && Numbers(data, big)(at, 2) < kSampleFormat) at += 12;
    if (at < end && Numbers(data, big)(at, 2) == kSampleFormat) {
        if (Numbers(data, big)(at + 4, 4) != 1) return false;  // several channels
        data.replace(at + 8, 2, text_of(2, 2));
        return true;
    }
    // One that does not say it: the page's directory goes to the end of the file, with the field.
    const std::string before = data.substr(page + 2, at - page - 2);
    const std::string behind = data.substr(at, end + 4 - at);
    if (data.size() % 2) data += '\0';
    data.replace(4, 4, text_of(static_cast<std::uint32_t>(data.size()), 4));
    data += text_of(static_cast<std::uint32_t>(count + 1), 2) + before + text_of(kSampleFormat, 2) +
            text_of(kShort, 2) + text_of(1, 4) + text_of(2, 2) + text_of(0, 2) + behind;
    return true;
}

void put_full_page_first(std::string& data, const std::string& name) {
    const std::string_view order = std::string_view(data).substr(0, 2);
    const bool big = order == "MM";
    if (order != "II" && !big) return;
    const Numbers number(data, big);
    if (number(2, 2) != 42) return;
    constexpr unsigned kWidth = 256, kHeight = 257;
    std::size_t best = 0, area = 0, of_that_size = 0;
    std::uint32_t sides[2] = {0, 0};
    std::set<std::size_t> seen;  // for pages may be chained in a circle
    for (std::size_t page = number(4, 4); page && seen.insert(page).second;) {
        const std::size_t fields = number(page, 2);
        std::uint32_t width = 0, height = 0;
        for (std::size_t i = 0; i < fields; ++i) {
            const std::size_t field = page + 2 + 12 * i;
            const std::uint32_t tag = number(field, 2);
            const std::uint32_t value = number(field + 8, number(field + 2, 2) == kShort ? 2 : 4);
            if (tag == kWidth) width = value;
            if (tag == kHeight) height = value;
        }
        const std::size_t own = std::size_t{width} * height;
        if (own > area) {
            area = own;
            best = page;
            of_that_size = 0;
            sides[0] = width;
            sides[1] = height;
        }
        of_that_size += own == area;
        page = number(page + 2 + 12 * fields, 4);
    }
    if (seen.size() < 2 || area == 0) return;
    if (of_that_size > 1)
        throw InputError(
            name + ": " + std::to_string(of_that_size) + " pages of " + std::to_string(sides[0]) +
            "x" + std::to_string(sides[1]) +
            ", expected one image; a TIFF stack is given by its file, not in a folder");
    for (std::size_t i = 0; i < 4; ++i)
        data[4 + (big ? 3 - i : i)] = static_cast<char>(best >> (8 * i) & 0xff);
}

}  // namespace xcalib

#include "xcalib/stream/tiff.hpp"

#include <cstdint>

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

}  // namespace xcalib

#include "xcalib/stream/npy.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <map>
#include <optional>
#include <string_view>
#include <vector>

#include "xcalib/error.hpp"
#include "xcalib/stream/files.hpp"

namespace xcalib {
namespace {

// numpy itself trusts no longer ones.
constexpr std::size_t kMaxHeader = 10000;
constexpr std::size_t kMaxSide = std::numeric_limits<int>::max();
constexpr std::size_t kMaxSides = 32;

struct Array {
    std::string type;      // a letter and the bytes of an element: f4
    bool swapped = false;  // big-endian
    bool fortran = false;  // column by column
    std::vector<std::size_t> shape;
};

// The header: a dictionary in Python's words, of three keys in any order.
class Header {
   public:
    explicit Header(std::string_view text) : text_(text) {}

    // None where it is anything else.
    std::optional<Array> parse() {
        Array array;
        int seen = 0;  // a bit for each key
        if (!take('{')) return std::nullopt;
        while (!take('}')) {
            const std::optional<std::string> key = word();
            if (!key || !take(':')) return std::nullopt;
            const int bit = *key == "descr"           ? 1
                            : *key == "fortran_order" ? 2
                            : *key == "shape"         ? 4
                                                      : 0;
            if (!bit || seen & bit) return std::nullopt;
            seen |= bit;
            if (!(bit == 1 ? descr(array) : bit == 2 ? order(array) : shape(array)))
                return std::nullopt;
            if (take(',')) continue;
            if (!take('}')) return std::nullopt;
            break;
        }
        skip();
        if (seen != 7 || at_ != text_.size()) return std::nullopt;
        return array;
    }

   private:
    void skip() { at_ = std::min(text_.find_first_not_of(" \n\r\t\f", at_), text_.size()); }
    bool take(char c) {
        skip();
        if (at_ == text_.size() || text_[at_] != c) return false;
        ++at_;
        return true;
    }
    bool take(std::string_view word) {
        skip();
        if (text_.substr(at_, word.size()) != word) return false;
        at_ += word.size();
        return true;
    }
    std::optional<std::string> word() {
        for (const char quote : {'\'', '"'})
            if (take(quote)) {
                const std::size_t end = text_.find(quote, at_);
                if (end == std::string_view::npos) return std::nullopt;
                const std::string_view inside = text_.substr(at_, end - at_);
                at_ = end + 1;
                if (inside.find_first_of("\\\n") != std::string_view::npos) return std::nullopt;
                return std::string(inside);
            }
        return std::nullopt;
    }

    bool descr(Array& array) {
        std::optional<std::string> text = word();
        if (!text || text->empty()) return false;  // of records, for one
        const char order = (*text)[0];
        if (std::string_view("<>=|").find(order) != std::string_view::npos) text->erase(0, 1);
        array.swapped = order == '>';
        array.type = *text;
        return true;
    }
    bool order(Array& array) {
        array.fortran = take("True");
        return array.fortran || take("False");
    }
    bool shape(Array& array) {
        if (!take('(')) return false;
        while (!take(')')) {
            skip();
            std::size_t side = 0;
            const std::size_t first = at_;
            for (; at_ < text_.size() && text_[at_] >= '0' && text_[at_] <= '9'; ++at_) {
                side = 10 * side + static_cast<std::size_t>(text_[at_] - '0');
                if (side > kMaxSide) return false;
            }
            if (at_ == first || array.shape.size() == kMaxSides) return false;
            array.shape.push_back(side);
            if (take(',')) continue;
            if (!take(')')) return false;
            return array.shape.size() != 1;  // (3) is a number, (3,) a shape
        }
        return true;
    }

    std::string_view text_;
    std::size_t at_ = 0;
};

// As numpy calls them.
std::string type_name(const std::string& type) {
    static const std::map<char, std::pair<const char*, int>> kKinds = {
        {'f', {"float", 8}}, {'i', {"int", 8}}, {'u', {"uint", 8}}, {'c', {"complex", 8}}};
    if (type == "b1") return "bool";
    const auto kind = type.empty() ? kKinds.end() : kKinds.find(type[0]);
    if (kind == kKinds.end() || type.size() < 2 || type.size() > 3 ||
        type.find_first_not_of("0123456789", 1) != std::string::npos)
        return "of type " + type.substr(0, 20);
    return kind->second.first + std::to_string(kind->second.second * std::stoi(type.substr(1)));
}

float of_half(std::uint16_t bits) {
    const int exponent = bits >> 10 & 31, mantissa = bits & 1023;
    const double size = exponent == 31  ? (mantissa ? NAN : INFINITY)
                        : exponent == 0 ? std::ldexp(mantissa, -24)
                                        : std::ldexp(1024 + mantissa, exponent - 25);
    return static_cast<float>(bits >> 15 ? -size : size);
}

template <class Number>
Number number_at(const char* bytes, bool swapped) {
    char own[sizeof(Number)];
    std::memcpy(own, bytes, sizeof own);
    if (swapped) std::reverse(own, own + sizeof own);
    Number value;
    std::memcpy(&value, own, sizeof own);
    return value;
}

float value_at(const char* bytes, std::size_t size, bool swapped) {
    if (size == 2) return of_half(number_at<std::uint16_t>(bytes, swapped));
    if (size == 4) return number_at<float>(bytes, swapped);
    return static_cast<float>(number_at<double>(bytes, swapped));
}

}  // namespace

Picture parse_npy(const std::string& data, const std::string& name, ArrayKind kind) {
    const auto damaged = [&] {
        return DecodeError(name + ": cannot decode, truncated or not a .npy array");
    };
    const auto byte = [&](std::size_t i) {
        return std::size_t{static_cast<std::uint8_t>(data[i])};
    };
    if (data.size() < 12 || data.compare(0, 6, "\x93NUMPY") != 0) throw damaged();
    const std::size_t version = byte(6), start = version == 1 ? 10 : 12;
    std::size_t length = byte(8) | byte(9) << 8;
    if (version != 1) length |= byte(10) << 16 | byte(11) << 24;
    if (version < 1 || version > 3 || byte(7) != 0 || length > kMaxHeader ||
        data.size() < start + length)
        throw damaged();
    const std::optional<Array> array = Header(std::string_view(data).substr(start, length)).parse();
    if (!array) throw damaged();

    std::string shape;
    for (const std::size_t side : array->shape)
        shape += (shape.empty() ? "" : ", ") + std::to_string(side);
    if (array->shape.size() == 1) shape += ",";
    const bool is_image = kind == ArrayKind::image;
    std::vector<std::size_t> sides = array->shape;
    if (sides.size() == 2) sides.push_back(1);
    const bool channels = sides.size() == 3 && (sides[2] == 1 || (is_image && sides[2] == 3));
    if (!channels || sides[0] == 0 || sides[1] == 0)
        throw InputError(name + (is_image ? ": the image" : ": depth") + " has shape (" + shape +
                         "), expected " +
                         (is_image ? "(h, w) or (h, w, 3)" : "one channel (h, w)"));
    const std::string& type = array->type;
    const bool is_float = type == "f2" || type == "f4" || type == "f8";
    if (!is_float && type != "u2" && !(is_image && type == "u1"))
        throw InputError(
            name + (is_image ? ": pixels are " : ": depth is ") + type_name(type) +
            (is_image ? ", expected uint8, uint16 or floats" : ", expected floats in metres"));
    const std::size_t bytes = static_cast<std::size_t>(type[1] - '0');
    const std::size_t height = sides[0], width = sides[1], count = sides[2];
    // Both sides fit 31 bits: their product is exact.
    if ((data.size() - start - length) / (bytes * count) < height * width) throw damaged();

    MutableImageView pixels;
    const PixelType stored = is_float       ? PixelType::f32
                             : type == "u2" ? PixelType::u16
                                            : PixelType::u8;
    Picture picture = new_picture(static_cast<int>(width), static_cast<int>(height),
                                  static_cast<int>(count), stored, pixels);
    const char* values = data.data() + start + length;
    const auto fill = [&](auto* out, const auto& value) {
        for (std::size_t y = 0; y < height; ++y)
            for (std::size_t x = 0; x < width; ++x)
                for (std::size_t c = 0; c < count; ++c) {
                    const std::size_t at =
                        array->fortran ? (c * width + x) * height + y : (y * width + x) * count + c;
                    *out++ = value(values + at * bytes);
                }
    };
    if (is_float)
        fill(static_cast<float*>(pixels.data),
             [&](const char* at) { return value_at(at, bytes, array->swapped); });
    else if (stored == PixelType::u16)
        fill(static_cast<std::uint16_t*>(pixels.data),
             [&](const char* at) { return number_at<std::uint16_t>(at, array->swapped); });
    else
        fill(static_cast<std::uint8_t*>(pixels.data),
             [](const char* at) { return static_cast<std::uint8_t>(*at); });
    return picture;
}

Picture read_npy(const std::filesystem::path& file, ArrayKind kind) {
    return parse_npy(read_file(file), file.string(), kind);
}

}  // namespace xcalib

#include "xcalib/footage/flir.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <map>

#include "xcalib/error.hpp"

namespace xcalib {
namespace {

using namespace std::string_view_literals;

// Numbers of a file, of either order of bytes. Throws where they are behind its end.
class Record {
   public:
    Record(std::string_view data, bool big, const std::string& name)
        : data_(data), big_(big), name_(name) {}

    std::uint32_t number(std::size_t at, std::size_t size) const {
        const std::string_view bytes = part(at, size);
        std::uint32_t value = 0;
        for (std::size_t i = 0; i < size; ++i)
            value = value << 8 | static_cast<std::uint8_t>(bytes[big_ ? i : size - 1 - i]);
        return value;
    }
    double real(std::size_t at) const {
        const std::uint32_t bits = number(at, 4);
        float value;
        std::memcpy(&value, &bits, 4);
        return value;
    }
    double whole(std::size_t at, std::size_t size) const {
        const std::uint32_t bits = number(at, size);
        return size == 2 ? static_cast<std::int16_t>(bits) : static_cast<std::int32_t>(bits);
    }
    std::string_view part(std::size_t at, std::size_t size) const {
        if (at > data_.size() || data_.size() - at < size) throw damaged();
        return data_.substr(at, size);
    }
    // One of its records, in the order of bytes that its first number, a small one, tells.
    Record inside(std::size_t at, std::size_t size) const {
        const std::string_view bytes = part(at, size);
        Record record(bytes, big_, name_);
        if (record.number(0, 2) > 0xff) record.big_ = !big_;
        return record;
    }
    std::string_view rest(std::size_t at) const {
        return part(at, data_.size() - std::min(at, data_.size()));
    }
    bool big() const { return big_; }
    DecodeError damaged() const {
        return DecodeError(name_ + ": cannot decode its radiometric part, truncated");
    }

   private:
    std::string_view data_;
    bool big_;
    const std::string& name_;
};

// The segments of a JPEG that FLIR writes, put together; empty where there are none.
std::string segments_of(std::string_view jpeg) {
    if (jpeg.substr(0, 2) != "\xff\xd8"sv) return "";
    std::map<int, std::string_view> parts;
    for (std::size_t at = 2; at + 4 <= jpeg.size() && jpeg[at] == '\xff';) {
        const std::size_t length = std::size_t{static_cast<std::uint8_t>(jpeg[at + 2])} << 8 |
                                   static_cast<std::uint8_t>(jpeg[at + 3]);
        if (jpeg[at + 1] == '\xda' || length < 2) break;
        // Its name, a version, the number of the part and of the last one.
        const std::string_view body = jpeg.substr(at + 4, length - 2);
        if (jpeg[at + 1] == '\xe1' && body.size() > 8 && body.substr(0, 5) == "FLIR\0"sv)
            parts[static_cast<std::uint8_t>(body[6])] = body.substr(8);
        at += 2 + length;
    }
    std::string joined;
    for (const auto& [_, part] : parts) joined += part;
    return joined;
}

constexpr std::uint32_t kRaw = 1, kEmbedded = 0x0e, kCamera = 0x20, kPicture = 0x2a;
constexpr std::size_t kPixels = 0x20;  // of a record of pixels, where they begin

void take_raw(const Record& record, FlirParts& parts) {
    parts.width = static_cast<int>(record.number(2, 2));
    parts.height = static_cast<int>(record.number(4, 2));
    parts.thermal = record.rest(kPixels);
    const bool is_png = parts.thermal.rfind("\x89PNG", 0) == 0;
    const std::string_view start = std::string_view(parts.thermal).substr(0, 4);
    parts.is_file = is_png || start == "II*\0"sv || start == "MM\0*"sv;
    parts.big_endian = is_png || (!parts.is_file && record.big());
}

void take_visible(const Record& record, FlirParts& parts) {
    parts.visible_width = static_cast<int>(record.number(2, 2));
    parts.visible_height = static_cast<int>(record.number(4, 2));
    parts.visible = record.rest(kPixels);
}

void take_camera(const Record& record, FlirParts& parts) {
    const Planck planck{record.real(0x58), record.real(0x5c), record.real(0x60),
                        record.whole(0x308, 4), record.real(0x30c)};
    if (planck.r1 > 0 && planck.b > 0 && planck.r2 > 0) parts.planck = planck;
}

}  // namespace

std::optional<FlirParts> flir_parts(std::string_view jpeg, const std::string& name) {
    const std::string data = segments_of(jpeg);
    if (data.compare(0, 4, "FFF\0", 4) != 0) return std::nullopt;
    // Versions are of two or three digits: in the other order of bytes they are not.
    const bool big = Record(data, true, name).number(0x14, 4) <= 0xffff;
    const Record file(data, big, name);
    FlirParts parts;
    const std::size_t directory = file.number(0x18, 4), count = file.number(0x1c, 4);
    if (count > 1000) throw file.damaged();
    for (std::size_t i = 0; i < count; ++i) {
        const std::size_t entry = directory + 32 * i;
        const std::uint32_t type = file.number(entry, 2);
        const std::size_t at = file.number(entry + 12, 4), size = file.number(entry + 16, 4);
        if (size == 0) continue;
        if (type == kRaw) take_raw(file.inside(at, size), parts);
        if (type == kEmbedded) take_visible(file.inside(at, size), parts);
        if (type == kCamera && size >= 0x310) take_camera(file.inside(at, size), parts);
        if (type == kPicture && size >= 8) {
            const Record record(file.part(at, size), file.big(), name);
            parts.real_to_ir = record.real(0);
            parts.offset_x = record.whole(4, 2);
            parts.offset_y = record.whole(6, 2);
        }
    }
    if (parts.thermal.empty()) return std::nullopt;
    return parts;
}

Rig flir_alignment(const FlirParts& parts, const std::string& name) {
    const bool sized =
        parts.width > 0 && parts.height > 0 && parts.visible_width > 0 && parts.visible_height > 0;
    if (!sized || !(parts.real_to_ir > 0.1 && parts.real_to_ir < 10))
        throw InputError(name +
                         ": does not say how the camera lays its images over each other, expected"
                         " a radiometric JPEG with Real2IR, or a rig file");
    constexpr double kFieldOfView = 45 * 3.14159265358979323846 / 180;
    Rig rig;
    rig.reference = Pinhole::from_hfov(parts.visible_width, parts.visible_height, kFieldOfView);
    // Thermal pixels of visible ones: the thermal image takes 1 / real_to_ir of the visible one's
    // width, about its middle and the offset.
    const double scale = parts.real_to_ir * parts.width / parts.visible_width;
    const Eigen::Vector2d middle(0.5 * (parts.width - 1), 0.5 * (parts.height - 1));
    const Eigen::Vector2d centre(0.5 * (parts.visible_width - 1) + parts.offset_x,
                                 0.5 * (parts.visible_height - 1) + parts.offset_y);
    Eigen::Matrix3d source_from_visible = Eigen::Vector3d(scale, scale, 1).asDiagonal();
    source_from_visible.topRightCorner<2, 1>() = middle - scale * centre;
    rig.source =
        Pinhole::from_K(parts.width, parts.height, source_from_visible * rig.reference.K());
    return rig;
}

void put_counts_right(FlirParts& parts) {
    const std::size_t size = std::size_t{2} * static_cast<std::size_t>(parts.width) *
                             static_cast<std::size_t>(parts.height);
    if (size == 0 || parts.thermal.size() < size)
        throw DecodeError("its thermal image is truncated");
    parts.thermal.resize(size);
    for (std::size_t i = 0; i < size; i += 2) {
        const auto first = static_cast<std::uint8_t>(parts.thermal[i]);
        const auto second = static_cast<std::uint8_t>(parts.thermal[i + 1]);
        const auto count = static_cast<std::uint16_t>(parts.big_endian ? first << 8 | second
                                                                       : second << 8 | first);
        std::memcpy(&parts.thermal[i], &count, 2);
    }
}

Image celsius_of(const ImageView& counts, const Planck& planck) {
    constexpr double kZeroCelsius = 273.15;
    Image out(counts.width, counts.height);
    for (int y = 0; y < counts.height; ++y)
        for (int x = 0; x < counts.width; ++x) {
            const double inside =
                planck.r1 / (planck.r2 * (counts.row<std::uint16_t>(y)[x] + planck.o)) + planck.f;
            out.row(y)[x] = inside > 1
                                ? static_cast<float>(planck.b / std::log(inside) - kZeroCelsius)
                                : std::numeric_limits<float>::quiet_NaN();
        }
    return out;
}

}  // namespace xcalib

#include "flir_files.hpp"

#include "xcalib/footage/flir.hpp"
#include "xcalib/stream/files.hpp"

namespace xcalib::cli {
namespace {

std::optional<FlirParts> parts_of(const Path& file) {
    const std::string suffix = lower_suffix(file);
    if ((suffix != ".jpg" && suffix != ".jpeg") || !std::filesystem::is_regular_file(file))
        return std::nullopt;
    return flir_parts(read_file(file), file.string());
}

cv::Mat counts_of(FlirParts parts, const std::string& where) {
    if (!parts.is_file) {
        try {
            put_counts_right(parts);
        } catch (const DecodeError& error) {
            throw DecodeError(where + ": " + error.what());
        }
        return cv::Mat(parts.height, parts.width, CV_16UC1, parts.thermal.data()).clone();
    }
    cv::Mat counts = decode_bytes(parts.thermal, where);
    if (counts.type() != CV_16UC1)
        throw DecodeError(where + ": counts are " + type_name(counts.depth()) +
                          ", expected uint16");
    if (parts.big_endian)
        for (int y = 0; y < counts.rows; ++y) {
            auto* row = counts.ptr<std::uint16_t>(y);
            for (int x = 0; x < counts.cols; ++x)
                row[x] = static_cast<std::uint16_t>(row[x] << 8 | row[x] >> 8);
        }
    return counts;
}

}  // namespace

bool is_radiometric(const Path& file) { return parts_of(file).has_value(); }

Rig radiometric_alignment(const Path& file) {
    const std::optional<FlirParts> parts = parts_of(file);
    if (!parts)
        throw InputError(file.string() +
                         ": no rig file and no radiometric JPEG of a FLIR camera, expected either");
    return flir_alignment(*parts, file.string());
}

std::string RadiometricFiles::where(int index) const {
    return ImageFiles::where(index) + " (" + part_ + ")";
}

Picture RadiometricFiles::read(int index) {
    const std::string file = ImageFiles::where(index), named = where(index);
    std::optional<FlirParts> parts = parts_of(file);
    if (!parts)
        throw InputError(file +
                         ": no radiometric JPEG of a FLIR camera, expected one to take its " +
                         part_ + " image");
    if (part_ == "visible") {
        if (parts->visible.empty())
            throw InputError(file + ": has no visible image in it, only the thermal one");
        return picture_of(as_image(decode_bytes(parts->visible, named), named));
    }
    const auto planck = parts->planck;
    const cv::Mat counts = counts_of(*std::move(parts), named);
    if (part_ == "thermal") return picture_of(counts);
    if (!planck) throw InputError(file + ": does not say what temperatures its counts are");
    return picture_of(celsius_of(view_of(counts), *planck));
}

}  // namespace xcalib::cli

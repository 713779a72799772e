#include "npy.hpp"

#include <cstdint>
#include <cstring>
#include <map>
#include <regex>
#include <string>
#include <vector>

#include "xcalib/stream/files.hpp"

namespace xcalib::cli {
namespace {

struct Header {
    std::string type;  // without its byte order
    bool swapped = false, fortran = false;
    std::vector<std::size_t> shape;
    std::size_t size = 0;  // of the header itself
};

bool read_header(const std::string& data, Header& header) {
    if (data.size() < 12 || data.compare(0, 6, "\x93NUMPY") != 0) return false;
    const auto byte = [&](std::size_t i) {
        return std::size_t{static_cast<std::uint8_t>(data[i])};
    };
    const std::size_t start = data[6] == 1 ? 10 : 12;
    std::size_t length = byte(8) | byte(9) << 8;
    if (start == 12) length |= byte(10) << 16 | byte(11) << 24;
    if (data.size() < start + length) return false;
    const std::string text = data.substr(start, length);
    static const std::regex type(R"('descr': *'([<>|=])([a-zA-Z]\d+)')");
    static const std::regex order(R"('fortran_order': *(True|False))");
    static const std::regex shape(R"('shape': *\(([0-9, ]*)\))");
    std::smatch found;
    if (!std::regex_search(text, found, type)) return false;
    header.swapped = found[1] == ">";
    header.type = found[2];
    if (!std::regex_search(text, found, order)) return false;
    header.fortran = found[1] == "True";
    if (!std::regex_search(text, found, shape)) return false;
    const std::string sides = found[1];
    static const std::regex digits("[0-9]+");
    for (auto it = std::sregex_iterator(sides.begin(), sides.end(), digits);
         it != std::sregex_iterator(); ++it) {
        if (it->length() > 9) return false;
        header.shape.push_back(std::stoul(it->str()));
    }
    header.size = start + length;
    return true;
}

}  // namespace

cv::Mat read_npy(const Path& file) {
    if (!std::filesystem::exists(file)) throw InputError(file.string() + ": no such file");
    const std::string data = read_file(file);
    const auto damaged = [&] {
        return DecodeError(file.string() + ": cannot decode, truncated or not a .npy array");
    };
    Header header;
    if (!read_header(data, header)) throw damaged();
    std::size_t count = 1;
    std::string shape;
    for (const std::size_t side : header.shape) {
        count *= side;
        shape += (shape.empty() ? "" : ", ") + std::to_string(side);
    }
    const std::size_t bytes =
        header.type.size() == 2 ? static_cast<std::size_t>(header.type[1] - '0') : 0;
    if (bytes > 0 && data.size() < header.size + count * bytes) throw damaged();
    std::vector<std::size_t> sides = header.shape;
    if (sides.size() == 3 && sides[2] == 1) sides.pop_back();
    if (sides.size() != 2 || count == 0)
        throw InputError(file.string() + ": depth has shape (" + shape +
                         "), expected one channel (h, w)");
    static const std::map<std::string, int> kFloats = {
        {"f2", CV_16F}, {"f4", CV_32F}, {"f8", CV_64F}};
    const auto type = kFloats.find(header.type);
    if (type == kFloats.end())
        throw InputError(file.string() + ": depth is " + header.type +
                         ", expected floats in metres");
    std::string values = data.substr(header.size, count * bytes);
    if (header.swapped)
        for (std::size_t i = 0; i < values.size(); i += bytes)
            std::reverse(values.begin() + static_cast<std::ptrdiff_t>(i),
                         values.begin() + static_cast<std::ptrdiff_t>(i + bytes));
    if (header.fortran) std::swap(sides[0], sides[1]);
    const cv::Mat stored(static_cast<int>(sides[0]), static_cast<int>(sides[1]), type->second,
                         values.data());
    cv::Mat depth;
    stored.convertTo(depth, CV_32F);
    if (header.fortran) depth = depth.t();
    return depth;
}

}  // namespace xcalib::cli

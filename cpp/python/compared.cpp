#include "compared.hpp"

#include "xcalib/gray.hpp"

namespace xcalib {
namespace {

Image gray_of(const char* name, const py::object& object, PixelType& type) {
    const Held held = image_of(name, object);
    type = held.view.type;
    return to_gray(held.view);
}

std::string size_text(const Image& image) {
    return std::to_string(image.width) + "x" + std::to_string(image.height);
}

double largest_of(PixelType type) {
    return type == PixelType::u8 ? 255 : type == PixelType::u16 ? 65535 : 1;
}

// Of the pixels that are valid.
void expect_unit_range(const char* name, const Image& image, const std::uint8_t* valid) {
    for (std::size_t i = 0; i < image.pixels.size(); ++i) {
        const float value = image.pixels[i];
        if ((!valid || valid[i]) && (value < 0 || value > 1))
            throw py::value_error(
                std::string(name) + " is float32 with the value " +
                std::string(py::str(py::float_(value))) +
                ", expected values in [0, 1], or data_range: the span that they may have");
    }
}

}  // namespace

Compared::Compared(const py::object& first, const py::object& second, const py::object& given,
                   decltype(&mask_of) read)
    : reference(gray_of("reference", first, types_[0])),
      registered(gray_of("registered", second, types_[1])) {
    if (reference.width != registered.width || reference.height != registered.height)
        throw py::value_error("registered is " + size_text(registered) +
                              ", expected the reference's " + size_text(reference));
    mask = read(given, reference.width, reference.height);
}

double Compared::range(const std::optional<double>& data_range) const {
    if (!data_range) {
        if (types_[0] == PixelType::f32) expect_unit_range("reference", reference, mask.data);
        if (types_[1] == PixelType::f32) expect_unit_range("registered", registered, mask.data);
        return 1;
    }
    if (types_[0] != types_[1])
        throw py::value_error(
            "data_range is given, but the images are of two types; expected both of one");
    return *data_range / largest_of(types_[0]);
}

}  // namespace xcalib

#include "compared.hpp"

#include "xcalib/gray.hpp"

namespace xcalib {
namespace {

Image gray_of(const char* name, const py::object& object) {
    return to_gray(image_of(name, object).view);
}

std::string size_text(const Image& image) {
    return std::to_string(image.width) + "x" + std::to_string(image.height);
}

}  // namespace

Compared::Compared(const py::object& first, const py::object& second, const py::object& valid)
    : reference(gray_of("reference", first)), registered(gray_of("registered", second)) {
    if (reference.width != registered.width || reference.height != registered.height)
        throw py::value_error("registered is " + size_text(registered) +
                              ", expected the reference's " + size_text(reference));
    mask = mask_of(valid, reference.width, reference.height);
}

}  // namespace xcalib

#include "arrays.hpp"

namespace xcalib {

std::string shape_text(const py::array& array) {
    std::string text = "shape (";
    for (py::ssize_t i = 0; i < array.ndim(); ++i)
        text += (i ? ", " : "") + std::to_string(array.shape(i));
    return text + ") " + std::string(py::str(array.dtype()));
}

Held image_of(const std::string& name, const py::object& object) {
    const py::array given = py::array::ensure(object);
    if (!given) throw py::value_error(name + " is not a numpy array");
    PixelType type;
    if (py::isinstance<py::array_t<std::uint8_t>>(given)) type = PixelType::u8;
    else if (py::isinstance<py::array_t<std::uint16_t>>(given)) type = PixelType::u16;
    else if (py::isinstance<py::array_t<float>>(given)) type = PixelType::f32;
    else
        throw py::value_error(name + " has " + shape_text(given) +
                              ", expected dtype uint8, uint16 or float32");
    const bool gray = given.ndim() == 2 || (given.ndim() == 3 && given.shape(2) == 1);
    if (!gray && !(given.ndim() == 3 && given.shape(2) == 3))
        throw py::value_error(name + " has " + shape_text(given) +
                              ", expected shape (H, W) or (H, W, 3)");
    if (given.size() == 0) throw py::value_error(name + " has " + shape_text(given) + ", is empty");
    Held held;
    held.array = py::array::ensure(given, py::array::c_style | kAligned);
    held.view = {
        held.array.data(),
        static_cast<int>(held.array.shape(1)),
        static_cast<int>(held.array.shape(0)),
        gray ? 1 : 3,
        type,
        static_cast<std::ptrdiff_t>(held.array.shape(1) * (gray ? 1 : 3) * held.array.itemsize())};
    return held;
}

Held depth_of(const std::string& name, const py::object& object, bool unit_known) {
    py::array given = py::array::ensure(object);
    if (!given) throw py::value_error(name + " is not a numpy array");
    if (py::isinstance<py::array_t<double>>(given)) given = py::array_t<float>::ensure(given);
    const bool is_depth = py::isinstance<py::array_t<float>>(given) ||
                          (unit_known && py::isinstance<py::array_t<std::uint16_t>>(given));
    if (!is_depth || given.ndim() != 2 || given.size() == 0)
        throw py::value_error(name + " has " + shape_text(given) +
                              ", expected shape (h, w) float32 in metres");
    return image_of(name, given);
}

HeldMask mask_of(const py::object& mask, int width, int height) {
    HeldMask held;
    if (mask.is_none()) return held;
    const py::array given = py::array::ensure(mask);
    if (!given || given.ndim() != 2 || given.shape(0) != height || given.shape(1) != width)
        throw py::value_error("mask has " + (given ? shape_text(given) : "no shape") +
                              ", expected the images' " + std::to_string(width) + "x" +
                              std::to_string(height));
    held.array = py::module_::import("numpy").attr("not_equal")(given, 0);
    held.data = held.array.data();
    return held;
}

}  // namespace xcalib

// numpy arrays as the core sees them.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <string>
#include <vector>

#include "xcalib/image.hpp"

namespace xcalib {

namespace py = pybind11;

inline std::string shape_text(const py::array& array) {
    std::string text = "shape (";
    for (py::ssize_t i = 0; i < array.ndim(); ++i)
        text += (i ? ", " : "") + std::to_string(array.shape(i));
    return text + ") " + std::string(py::str(array.dtype()));
}

inline constexpr int kAligned = py::detail::npy_api::NPY_ARRAY_ALIGNED_;

// A view on a numpy array, and the array that owns it (a copy where rows are not contiguous or
// numbers not aligned).
struct Held {
    py::array array;
    ImageView view;
};

inline Held image_of(const std::string& name, const py::object& object) {
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

// Depth in metres: float32; float64 is converted. Integers are refused, they carry no unit, unless
// the unit of uint16 is known.
inline Held depth_of(const std::string& name, const py::object& object, bool unit_known = false) {
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

struct HeldList {
    std::vector<Held> held;
    std::vector<ImageView> views;
};

template <class Convert>
HeldList list_of(const char* name, const py::sequence& sequence, const Convert& convert) {
    HeldList list;
    for (std::size_t i = 0; i < sequence.size(); ++i) {
        list.held.push_back(
            convert(std::string(name) + " frame " + std::to_string(i), sequence[i]));
        list.views.push_back(list.held.back().view);
    }
    return list;
}

}  // namespace xcalib

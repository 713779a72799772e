// numpy arrays as the core sees them, and back.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <string>
#include <utility>
#include <vector>

#include "xcalib/image.hpp"

namespace xcalib {

namespace py = pybind11;

std::string shape_text(const py::array& array);

inline constexpr int kAligned = py::detail::npy_api::NPY_ARRAY_ALIGNED_;

// A view on a numpy array, and the array that owns it (a copy where rows are not contiguous or
// numbers not aligned).
struct Held {
    py::array array;
    ImageView view;
};

// (H, W) or (H, W, 3) of uint8, uint16 or float32. Throws ValueError with shape and dtype.
Held image_of(const std::string& name, const py::object& object);

// Depth in metres: float32; float64 is converted. Integers are refused, they carry no unit, unless
// the unit of uint16 is known.
Held depth_of(const std::string& name, const py::object& object, bool unit_known = false);

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

// A mask as one byte a pixel, nonzero where valid; None is everywhere.
struct HeldMask {
    py::array_t<std::uint8_t, py::array::c_style | py::array::forcecast> array;
    const std::uint8_t* data = nullptr;
};
HeldMask mask_of(const py::object& mask, int width, int height);

template <class Value>
py::array_t<Value> array_of(const std::vector<Value>& values, int width, int height) {
    return py::array_t<Value>({height, width}, values.data());
}
inline py::array_t<float> array_of(const Image& image) {
    return array_of(image.pixels, image.width, image.height);
}

// What the work gives, done without Python's lock.
template <class Work>
auto unlocked(const Work& work) {
    const py::gil_scoped_release released;
    return work();
}

}  // namespace xcalib

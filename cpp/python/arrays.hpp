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

// (H, W) or (H, W, 3) of uint8, uint16 or float32; other floats are converted, and masked pixels
// become NaN. Throws ValueError with shape and dtype, or what was given instead of an array.
Held image_of(const std::string& name, const py::object& object);

// Depth in metres: float32; other floats are converted, and masked pixels become 0, unknown.
// Integers are refused, they carry no unit, unless the unit of uint16 is known.
Held depth_of(const std::string& name, const py::object& object, bool unit_known = false);
inline Held metric_depth_of(const std::string& name, const py::object& object) {
    return depth_of(name, object);
}

struct HeldList {
    std::vector<Held> held;
    std::vector<ImageView> views;
};

// Frames as a list: a sequence is one, anything else that can be iterated over is made one. Throws
// TypeError where it cannot be, or is one image.
py::sequence frames_of(const std::string& name, const py::object& frames);

template <class Convert>
HeldList list_of(const std::string& name, const py::object& frames, const Convert& convert) {
    const py::sequence sequence = frames_of(name, frames);
    HeldList list;
    for (std::size_t i = 0; i < sequence.size(); ++i) {
        list.held.push_back(convert(name + " frame " + std::to_string(i), sequence[i]));
        list.views.push_back(list.held.back().view);
    }
    return list;
}

// A registrar's mask (0 valid) as the core's: one byte a pixel, nonzero where valid; None is
// everywhere. Throws ValueError where it is none, as one of another sense.
struct HeldMask {
    py::array_t<std::uint8_t, py::array::c_style | py::array::forcecast> array;
    const std::uint8_t* data = nullptr;
};
HeldMask mask_of(const py::object& mask, int width, int height);

// The same of an array that is nonzero where valid, as flow providers are given.
HeldMask valid_of(const py::object& valid, int width, int height);

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

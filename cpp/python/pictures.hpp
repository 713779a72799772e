// Pictures as numpy arrays and back, without copies.
#pragma once

#include "arrays.hpp"
#include "xcalib/stream/picture.hpp"

namespace xcalib {

// A Python object held by threads that need not have Python's lock.
struct LetGo {
    void operator()(const py::object* object) const {
        const py::gil_scoped_acquire locked;
        delete object;
    }
};
using Kept = std::shared_ptr<const py::object>;
inline Kept kept(py::object object) { return {new py::object(std::move(object)), LetGo{}}; }

inline Picture picture_of(Held held) { return {held.view, kept(std::move(held.array))}; }

inline py::object array_of(const Picture& picture) {
    // The array that it was made of.
    if (std::get_deleter<LetGo>(picture.owner))
        return *static_cast<const py::object*>(picture.owner.get());
    const ImageView& view = picture.view;
    const char* const types[] = {"u1", "u2", "f4"};
    const py::dtype type(types[static_cast<int>(view.type)]);
    const py::ssize_t item = type.itemsize();
    std::vector<py::ssize_t> shape{view.height, view.width};
    std::vector<py::ssize_t> strides{view.row_bytes, item * view.channels};
    if (view.channels > 1) {
        shape.push_back(view.channels);
        strides.push_back(item);
    }
    const py::capsule owner(new Picture(picture),
                            [](void* held) { delete static_cast<Picture*>(held); });
    return py::array(type, shape, strides, view.data, owner);
}

}  // namespace xcalib

template <>
struct pybind11::detail::type_caster<xcalib::Picture> {
    PYBIND11_TYPE_CASTER(xcalib::Picture, const_name("numpy.ndarray"));

    bool load(handle array, bool) {
        value = xcalib::picture_of(xcalib::image_of("image", reinterpret_borrow<object>(array)));
        return true;
    }
    static handle cast(const xcalib::Picture& picture, return_value_policy, handle) {
        return xcalib::array_of(picture).release();
    }
};

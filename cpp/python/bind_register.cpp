#include <pybind11/stl.h>

#include <cmath>

#include "arrays.hpp"
#include "bindings.hpp"
#include "xcalib/option_words.hpp"
#include "xcalib/register.hpp"

namespace xcalib {
namespace {

// The caller's array to write to, which shares nothing with `others`, or a new one.
py::array result_of(const char* name, const py::object& object, const py::dtype& dtype,
                    const std::vector<py::ssize_t>& shape,
                    std::initializer_list<std::pair<const char*, const py::array&>> others) {
    if (object.is_none()) return py::array(dtype, shape);
    if (!py::isinstance<py::array>(object))
        throw py::value_error(std::string(name) + " is not a numpy array");
    const auto given = py::reinterpret_borrow<py::array>(object);
    const bool fits =
        std::equal(shape.begin(), shape.end(), given.shape(), given.shape() + given.ndim()) &&
        given.dtype().equal(dtype);
    constexpr int kFlags = py::array::c_style | kAligned;
    if (!fits || !given.writeable() || (given.flags() & kFlags) != kFlags)
        throw py::value_error(std::string(name) + " has " + shape_text(given) + ", expected " +
                              shape_text(py::array(dtype, shape)) +
                              ", contiguous, aligned and writeable");
    const auto begin = [](const py::array& a) { return static_cast<const char*>(a.data()); };
    for (const auto& [other, array] : others)
        if (begin(given) < begin(array) + array.nbytes() &&
            begin(array) < begin(given) + given.nbytes())
            throw py::value_error(std::string(name) + " overlaps " + other +
                                  ", expected memory of its own");
    return given;
}

Registrar make_registrar(const Rig& rig, int num_threads, bool nearest,
                         const std::string& occlusion, const std::optional<double>& depth_scale) {
    if (depth_scale && !(std::isfinite(*depth_scale) && *depth_scale > 0))
        throw py::value_error("depth_scale is " + std::to_string(*depth_scale) +
                              ", expected metres per unit, > 0, or None");
    return Registrar(rig, {num_threads, nearest, value_of<Occlusion>("occlusion", occlusion),
                           depth_scale.value_or(0)});
}

py::array_t<float> map(const Registrar& registrar, const py::object& depth) {
    const Held d = depth_of("depth", depth, registrar.options().depth_scale > 0);
    const Pinhole& grid = registrar.rig().reference;
    py::array_t<float> out({grid.height, grid.width, 2});
    float* data = out.mutable_data();
    {
        const py::gil_scoped_release released;
        registrar.map(d.view, data);
    }
    return out;
}

py::tuple register_frame(const Registrar& registrar, const py::object& source,
                         const py::object& depth, const py::object& out, const py::object& mask) {
    const Held s = image_of("source", source);
    const Held d = depth_of("depth", depth, registrar.options().depth_scale > 0);
    const Pinhole& grid = registrar.rig().reference;
    std::vector<py::ssize_t> shape{grid.height, grid.width};
    py::array codes = result_of("mask", mask, py::dtype::of<std::uint8_t>(), shape,
                                {{"source", s.array}, {"depth", d.array}});
    if (s.array.ndim() == 3) shape.push_back(s.array.shape(2));
    py::array image = result_of("out", out, s.array.dtype(), shape,
                                {{"source", s.array}, {"depth", d.array}, {"mask", codes}});
    const MutableImageView pixels{
        image.mutable_data(),
        grid.width,
        grid.height,
        s.view.channels,
        s.view.type,
        static_cast<std::ptrdiff_t>(grid.width * s.view.channels * image.itemsize())};
    auto* written = static_cast<std::uint8_t*>(codes.mutable_data());
    {
        const py::gil_scoped_release released;
        registrar.register_frame(s.view, d.view, pixels, written);
    }
    return py::make_tuple(image, codes);
}

}  // namespace

void bind_register(py::module_& m) {
    py::class_<Registrar>(m, "Registrar", R"(One rig, a stream of frames, Eq. (warping).

num_threads: 0 uses every core. nearest: register() takes the source pixel next to the point as it
is, instead of interpolating between four, so that radiometric counts are never mixed. occlusion,
what the source camera sees something nearer in front of: "mark" gives it mask code 2, and the image
shows what is in front; "hide" makes it 0 in the image and NaN in the map too, so that nothing is
seen twice; "ignore" does not look for it. depth_scale: metres per unit of uint16 depth (1 / 256 is KITTI's), 0 unknown; None
refuses integers. Raises ValueError where the rig or an option is not valid.)")
        .def(py::init(&make_registrar), py::arg("rig"), py::arg("num_threads") = 0,
             py::arg("nearest") = false, py::arg("occlusion") = "mark",
             py::arg("depth_scale") = py::none())
        .def(py::pickle(
            [](const Registrar& registrar) {
                const RegistrarOptions& o = registrar.options();
                return py::make_tuple(registrar.rig(), o.num_threads, o.nearest,
                                      std::string(word_of(o.occlusion)), o.depth_scale);
            },
            [](const py::tuple& s) {
                return Registrar(s[0].cast<Rig>(),
                                 {s[1].cast<int>(), s[2].cast<bool>(),
                                  value_of<Occlusion>("occlusion", s[3].cast<std::string>()),
                                  s[4].cast<double>()});
            }))
        .def("__repr__",
             [](const Registrar& registrar) {
                 return "Registrar(" + std::string(py::repr(py::cast(registrar.rig()))) + ")";
             })
        .def_property_readonly("rig", &Registrar::rig, "A copy of the rig.",
                               py::return_value_policy::copy)
        .def("map", &map, py::arg("depth"),
             "(H, W, 2) float32: x and y in the source image [px] of each reference pixel, NaN "
             "where it is not valid. depth: as in register().")
        .def("register", &register_frame, py::arg("source"), py::arg("depth"),
             py::arg("out") = py::none(), py::arg("mask") = py::none(),
             R"(The source on the reference grid, and what each pixel is worth.

source: (h, w) or (h, w, 3) uint8 | uint16 | float32 (float64 is converted to it) of the rig's
source size; depth: (h, w) float32
[m], or uint16 if depth_scale was given, of the reference's aspect. out, mask: contiguous arrays to
write the results to, which overlap no other; else new ones are made, which for large
images takes as long as filling them. Returns (image, mask): image (H, W[, 3]) in the source's
dtype, 0 where not valid, unless marked as occluded only; mask (H, W) uint8: 0 valid, 1 outside the
source, 2 occluded, 3 no depth.
Raises ValueError with shapes and dtypes.)");
}

}  // namespace xcalib

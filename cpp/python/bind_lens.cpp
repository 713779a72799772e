#include <pybind11/eigen.h>

#include <limits>

#include "value_class.hpp"
#include "xcalib/lens.hpp"

namespace xcalib {
namespace {

namespace py = pybind11;

using Points = Eigen::Matrix<double, Eigen::Dynamic, 2, Eigen::RowMajor>;

// NaN where there is none.
template <class Map>
Points each(const Points& points, const Map& map) {
    Points out(points.rows(), 2);
    for (Eigen::Index i = 0; i < points.rows(); ++i) {
        const auto to = map(Eigen::Vector2d(points.row(i).transpose()));
        out.row(i).setConstant(std::numeric_limits<double>::quiet_NaN());
        if (to) out.row(i) = to->transpose();
    }
    return out;
}

Lens make_lens(const std::string& model, const std::vector<double>& coefficients) {
    const auto known = lens_model_of(model);
    if (!known)
        throw py::value_error("Lens: model = '" + model + "', expected none, brown or fisheye");
    const Lens lens(*known, coefficients);
    lens.validate("Lens");
    return lens;
}

}  // namespace

void bind_lens(py::module_& m) {
    py::class_<Lens>(m, "Lens",
                     R"(What a lens does to a pinhole's image: OpenCV's models and coefficients.

brown: k1 k2 p1 p2 [k3 [k4 k5 k6]]; fisheye: k1 k2 k3 k4; none. Points are normalized: (X/Z, Y/Z)
before the lens, and what the intrinsic matrix takes to pixels after it.)")
        .def(py::init(&make_lens), py::arg("model") = "none",
             py::arg("coefficients") = std::vector<double>{},
             "Raises ValueError where the model is unknown, or has not so many coefficients.")
        .def_static("parse", &Lens::parse, py::arg("option"), py::arg("word"),
                    "The lens of a word as --source-lens takes it, 'brown:K1,K2,P1,P2'; None for "
                    "'auto'. InputError, naming the option, otherwise.")
        .def_property_readonly(
            "model", [](const Lens& lens) { return name_of(lens.model()); },
            "'none', 'brown' or 'fisheye'.")
        .def_property_readonly("coefficients", &Lens::coefficients, "As many as were given.")
        .def_property_readonly("bends", &Lens::bends, "Whether it does anything.")
        .def_property_readonly("max_radius", &Lens::max_radius,
                               "Points farther from the axis, before the lens, have no image.")
        .def(
            "distort",
            [](const Lens& lens, const Points& points) {
                return each(points, [&](const Eigen::Vector2d& p) { return lens.distort(p); });
            },
            py::arg("points"), "(N, 2) where the lens shows points (N, 2); NaN where nowhere.")
        .def(
            "undistort",
            [](const Lens& lens, const Points& points) {
                return each(points, [&](const Eigen::Vector2d& p) { return lens.undistort(p); });
            },
            py::arg("points"), "(N, 2) points that the lens shows at (N, 2); NaN where none.")
        .def(
            "__eq__", [](const Lens& a, const Lens& b) { return a == b; }, py::is_operator())
        .def(py::pickle(
            [](const Lens& lens) {
                return py::make_tuple(std::string(name_of(lens.model())), lens.coefficients());
            },
            [](const py::tuple& state) {
                return make_lens(state[0].cast<std::string>(),
                                 state[1].cast<std::vector<double>>());
            }))
        .def("__copy__", [](const Lens& lens) { return Lens(lens); })
        .def(
            "__deepcopy__", [](const Lens& lens, const py::dict&) { return Lens(lens); },
            py::arg("memo"))
        .def("__hash__", [](const Lens& lens) { return py::hash(py::str(Lens::word(lens))); })
        .def("__repr__", [](const Lens& lens) {
            const py::object coefficients = py::cast(lens.coefficients());
            return "Lens('" + std::string(name_of(lens.model())) + "', " +
                   std::string(py::repr(coefficients)) + ")";
        });
}

}  // namespace xcalib

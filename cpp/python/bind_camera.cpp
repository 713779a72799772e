// Cameras and rigs, and rig files.
#include <pybind11/eigen.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <sstream>

#include "value_class.hpp"
#include "xcalib/mount.hpp"
#include "xcalib/rig_file.hpp"

namespace xcalib {
namespace {

namespace py = pybind11;

constexpr double kDegree = 3.14159265358979323846 / 180;

template <class Matrix>
Matrix numbers_of(const char* name, const py::object& object, const char* expected) {
    try {
        return object.cast<Matrix>();
    } catch (const py::cast_error&) {
        throw py::value_error(std::string(name) + " is " + std::string(py::repr(object)) +
                              ", expected " + expected);
    }
}

// Read-only, for a copy that is changed changes no camera.
template <class Matrix>
py::array frozen(const Matrix& matrix) {
    const py::array out = py::cast(matrix);
    out.attr("setflags")(py::arg("write") = false);
    return out;
}

Rig make_rig(const Pinhole& reference, const Pinhole& source, const py::object& R,
             const py::object& t) {
    Rig rig;
    rig.reference = reference;
    rig.source = source;
    if (!R.is_none())
        rig.source_from_reference.rotation =
            rotation_of(numbers_of<Eigen::Matrix3d>("R", R, "a (3, 3) array of numbers"));
    if (!t.is_none())
        rig.source_from_reference.translation =
            numbers_of<Eigen::Vector3d>("t", t, "a (3,) array of numbers");
    rig.validate();
    return rig;
}

std::string text_of(const Pinhole& c) {
    std::ostringstream out;
    out << "Pinhole(width=" << c.width << ", height=" << c.height << ", fx=" << c.fx
        << ", fy=" << c.fy << ", cx=" << c.cx << ", cy=" << c.cy << ", skew=" << c.skew;
    if (c.lens.model() != LensModel::none)
        out << ", lens=" << std::string(py::repr(py::cast(c.lens)));
    out << ")";
    return out.str();
}

void bind_pinhole(py::module_& m) {
    ValueClass<Pinhole>(m, "Pinhole",
                        R"(A pinhole camera, Eq. (intrinsic) of the paper, and its lens.

Pixel centres lie at integer coordinates; all lengths in pixels. Fields may be set.)")
        .def(py::init([](int width, int height, double fx, double fy, double cx, double cy,
                         double skew, const std::optional<Lens>& lens) {
                 const Pinhole camera{width, height, fx, fy, cx, cy, skew, lens.value_or(Lens())};
                 camera.validate("Pinhole");
                 return camera;
             }),
             py::arg("width"), py::arg("height"), py::arg("fx"), py::arg("fy"), py::arg("cx"),
             py::arg("cy"), py::arg("skew") = 0.0, py::arg("lens") = py::none(),
             "Raises ValueError where a size is below 1, a focal length not > 0, or a value not "
             "finite.")
        .def_static(
            "from_hfov",
            [](int width, int height, double hfov_deg, const std::optional<Lens>& lens) {
                return Pinhole::from_hfov(width, height, hfov_deg * kDegree, lens.value_or(Lens()));
            },
            py::arg("width"), py::arg("height"), py::arg("hfov_deg"), py::arg("lens") = py::none(),
            "Square pixels and the principal point at the centre; hfov_deg in (0, 180), and no "
            "wider than what the lens shows.")
        .def_static(
            "from_K",
            [](int width, int height, const Eigen::Matrix3d& K, const std::optional<Lens>& lens) {
                Pinhole camera = Pinhole::from_K(width, height, K);
                if (lens) camera.lens = *lens;
                camera.validate("camera");
                return camera;
            },
            py::arg("width"), py::arg("height"), py::arg("K"), py::arg("lens") = py::none(),
            "Of a (3, 3) intrinsic matrix [px], as OpenCV has it.")
        .def_readwrite("width", &Pinhole::width, "[px]")
        .def_readwrite("height", &Pinhole::height, "[px]")
        .def_readwrite("fx", &Pinhole::fx, "[px]")
        .def_readwrite("fy", &Pinhole::fy, "[px]")
        .def_readwrite("cx", &Pinhole::cx, "[px]")
        .def_readwrite("cy", &Pinhole::cy, "[px]")
        .def_readwrite("skew", &Pinhole::skew, "[px]")
        .def_readwrite("lens", &Pinhole::lens, "Lens between (X/Z, Y/Z) and K.")
        .def_property_readonly(
            "K", [](const Pinhole& c) { return frozen(c.K()); },
            "(3, 3) float64 intrinsic matrix [px], read-only.")
        .def_property_readonly(
            "hfov_deg", [](const Pinhole& c) { return c.hfov() / kDegree; },
            "Horizontal field of view, 2 atan(width / (2 fx)) without a lens [deg].")
        .def_property_readonly(
            "vfov_deg", [](const Pinhole& c) { return c.vfov() / kDegree; },
            "Vertical field of view [deg].")
        .def("resized", &Pinhole::resized, py::arg("width"), py::arg("height"),
             "The same camera behind an image of another size [px].")
        .def("__repr__", &text_of)
        .as_value(true);
}

void bind_relative_depth(py::module_& m) {
    ValueClass<RelativeDepth>(m, "RelativeDepth",
                              R"(Relative inverse depth r in metres: D = 1 / (scale r + shift).

A rig that was calibrated with it has its translation in the unit that the scale stands for.)")
        .def(py::init([](double scale, double shift) {
                 const RelativeDepth relative{scale, shift};
                 relative.validate("RelativeDepth");
                 return relative;
             }),
             py::arg("scale"), py::arg("shift"),
             "Raises ValueError where the scale is not > 0, or a value not finite.")
        .def_readonly("scale", &RelativeDepth::scale, "> 0")
        .def_readonly("shift", &RelativeDepth::shift, "[1/m], if the scale is of metres.")
        .def("__repr__",
             [](const RelativeDepth& r) {
                 std::ostringstream out;
                 out << "RelativeDepth(scale=" << r.scale << ", shift=" << r.shift << ")";
                 return out.str();
             })
        .as_value(true);
}

void bind_rig_pose(py::class_<Rig>& rig) {
    rig.def_property(
           "R", [](const Rig& rig) { return frozen(rig.R()); },
           [](Rig& rig, const Eigen::Matrix3d& R) {
               rig.source_from_reference.rotation =
                   make_rig(rig.reference, rig.source, py::cast(R), py::none())
                       .source_from_reference.rotation;
           },
           "(3, 3) float64 rotation, source_from_reference; read-only, but set whole.")
        .def_property(
            "t", [](const Rig& rig) { return frozen(rig.t()); },
            [](Rig& rig, const Eigen::Vector3d& t) {
                rig.source_from_reference.translation =
                    make_rig(rig.reference, rig.source, py::none(), py::cast(t)).t();
            },
            "(3,) float64 translation, source_from_reference [m]; read-only, but set whole.")
        .def_property_readonly(
            "quaternion_wxyz",
            [](const Rig& rig) {
                const Eigen::Quaterniond& q = rig.source_from_reference.rotation;
                return frozen(Eigen::Vector4d(q.w(), q.x(), q.y(), q.z()));
            },
            "(4,) float64 unit quaternion of R.")
        .def_property_readonly(
            "infinite_homography", [](const Rig& rig) { return frozen(infinite_homography(rig)); },
            "(3, 3) float64, K_S R K_R^-1: where points at infinity go, lenses aside.");
}

void bind_rig_files(py::class_<Rig>& rig) {
    rig.def(
           "save",
           [](const Rig& rig, const std::filesystem::path& path) { save_rig(rig, path.string()); },
           py::arg("path"), "Writes the rig file, whole or not at all. OSError names the path.")
        .def_static(
            "load", [](const std::filesystem::path& path) { return load_rig(path.string()); },
            py::arg("path"),
            "Reads a rig file. OSError where it cannot be read; ValueError, with the path, the "
            "field "
            "and what was expected, where it is not a rig.");
}

void bind_rig(py::module_& m) {
    py::class_<Rig> rig(m, "Rig", R"(A reference and a source camera, fixed to each other.

`R` and `t` take points of the reference camera to the source camera: X_S = R X_R + t.)");
    rig.def(py::init(&make_rig), py::arg("reference"), py::arg("source"), py::arg("R") = py::none(),
            py::arg("t") = py::none(),
            "R: (3, 3) rotation, default identity. t: (3,) [m], default zero. ValueError "
            "otherwise.")
        .def_readwrite("reference", &Rig::reference, "Pinhole that gives the pixel grid.")
        .def_readwrite("source", &Rig::source, "Pinhole whose images are registered.")
        .def_readwrite("relative_depth", &Rig::relative_depth,
                       "RelativeDepth it was calibrated with, or None: metric depth.")
        .def_readwrite("source_mirrored", &Rig::source_mirrored,
                       "Whether the source image is a mirror image: u = cx - fx X/Z + skew Y/Z.")
        .def_property_readonly(
            "verdict", [](const Rig& rig) { return std::const_pointer_cast<Verdict>(rig.verdict); },
            "Verdict of the calibration that estimated it, or None where it is not known.")
        .def_property_readonly(
            "mount", [](const Rig& rig) { return Mount::of(rig).text(); },
            "How the source image is turned against the reference's, in words: 'upright' up to 15 "
            "deg of roll, 'upside down', 'turned by 90 deg clockwise', 'mirrored', ...");
    bind_rig_pose(rig);
    bind_rig_files(rig);
    rig.def("resized", &Rig::resized, py::arg("reference_width"), py::arg("reference_height"),
            py::arg("source_width"), py::arg("source_height"),
            "The same rig behind images of other sizes [px].")
        .def("fitted", &fitted, py::arg("reference_width"), py::arg("reference_height"),
             py::arg("source_width"), py::arg("source_height"),
             "The rig for images of these sizes [px]: itself, or resized where both have its "
             "aspects, to within a pixel. Raises InputError where one has not.")
        .def("__repr__", [](const Rig& rig) {
            std::ostringstream out;
            out << "Rig(reference=" << text_of(rig.reference) << ", source=" << text_of(rig.source)
                << ", t=[" << rig.t().transpose() << "])";
            return out.str();
        });
    rig.def(
        "_repr_html_",
        [](const py::object& self) {
            return py::module_::import("xcalib.notebook").attr("rig_html")(self);
        },
        "What a notebook shows: where the source camera looks, on the reference's image.");
    // By the text of its file, which has all of it, to the last bit; a rig of a report that none
    // was found for has none.
    rig.def(py::pickle(
        [](const Rig& rig) {
            const bool is_set = rig.reference.width > 0;
            return py::make_tuple(is_set ? rig_text(rig) : "");
        },
        [](const py::tuple& state) {
            const auto text = state[0].cast<std::string>();
            return text.empty() ? Rig{} : rig_of_text(text);
        }));
    def_copies(rig);
}

}  // namespace

void bind_camera(py::module_& m) {
    bind_pinhole(m);
    bind_relative_depth(m);
    bind_rig(m);
}

}  // namespace xcalib

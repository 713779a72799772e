#include "arrays.hpp"
#include "bindings.hpp"
#include "xcalib/depth/plane_depth.hpp"

namespace xcalib {

void bind_plane_depth(py::module_& m) {
    py::class_<PlaneDepth>(m, "PlaneDepth",
                           R"(Road-plane prior: a flat road under the camera, all else far away.

D(x, y) = camera_height * fy / r(x, y), where r is the distance of a pixel below the horizon [px],
never beyond far, which is also the depth at and above the horizon.)")
        .def(py::init([](double camera_height, double horizon, double far, double hfov_deg,
                         double roll_deg) {
                 const PlaneDepth plane{camera_height, horizon, far, hfov_deg, roll_deg};
                 plane.validate();
                 return plane;
             }),
             py::arg("camera_height") = PlaneDepth{}.camera_height,
             py::arg("horizon") = PlaneDepth{}.horizon, py::arg("far") = PlaneDepth{}.far,
             py::arg("hfov_deg") = PlaneDepth{}.hfov_deg,
             py::arg("roll_deg") = PlaneDepth{}.roll_deg, "Raises InputError: field, value, range.")
        .def_readonly("camera_height", &PlaneDepth::camera_height,
                      "Height of the reference camera above the road [m], > 0.")
        .def_readonly("horizon", &PlaneDepth::horizon,
                      "Its row in the middle column, as a fraction of the image height from the "
                      "top, (-1, 1).")
        .def_readonly("far", &PlaneDepth::far, "Largest depth [m], > 0.")
        .def_readonly(
            "hfov_deg", &PlaneDepth::hfov_deg,
            "Horizontal field of view of the reference camera [deg], (0, 180); pixels are square.")
        .def_readonly("roll_deg", &PlaneDepth::roll_deg,
                      "How far the horizon falls towards the right [deg], (-45, 45).")
        .def_property_readonly(
            "parallel", [](const PlaneDepth&) { return true; },
            "Several threads may ask for depth at a time.")
        .def(
            "__call__",
            [](const PlaneDepth& plane, int, const py::array& reference) {
                return array_of(plane(static_cast<int>(reference.shape(1)),
                                      static_cast<int>(reference.shape(0))));
            },
            py::arg("index"), py::arg("reference"),
            "Depth of any frame: (H, W) float32 [m], of the reference image's size.");
}

}  // namespace xcalib

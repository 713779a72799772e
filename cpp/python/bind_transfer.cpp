#include "arrays.hpp"
#include "bindings.hpp"
#include "xcalib/transfer.hpp"

namespace xcalib {
namespace {

using Points = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Codes = py::array_t<std::uint8_t>;

// A function of each of (N, 2) points: their places, depths and codes.
template <class Move>
py::tuple each(const Points& points, const Move& move) {
    if (points.ndim() != 2 || points.shape(1) != 2)
        throw py::value_error("points have " + shape_text(points) + ", expected (N, 2)");
    const py::ssize_t count = points.shape(0);
    Points places({count, py::ssize_t{2}}), depths(count);
    Codes codes(count);
    const double* in = points.data();
    double *out = places.mutable_data(), *z = depths.mutable_data();
    std::uint8_t* code = codes.mutable_data();
    unlocked([&] {
        for (py::ssize_t i = 0; i < count; ++i) {
            const TransferredPoint p = move(Eigen::Vector2d(in[2 * i], in[2 * i + 1]), i);
            out[2 * i] = p.point.x();
            out[2 * i + 1] = p.point.y();
            z[i] = p.depth;
            code[i] = static_cast<std::uint8_t>(p.code);
        }
    });
    return py::make_tuple(places, depths, codes);
}

// The places alone, NaN where they are not in the other image, if that is asked for.
Points places_of(const py::tuple& found, bool beyond) {
    auto places = found[0].cast<Points>();
    if (beyond) return places;
    const auto codes = found[2].cast<Codes>();
    for (py::ssize_t i = 0; i < codes.size(); ++i)
        if (codes.data()[i] == static_cast<std::uint8_t>(Transferred::outside))
            places.mutable_data()[2 * i] = places.mutable_data()[2 * i + 1] =
                std::numeric_limits<double>::quiet_NaN();
    return places;
}

// One depth of all points, or one each; empty where it is a map.
Points depths_of(const py::object& depth, py::ssize_t count) {
    const auto given = Points::ensure(depth);
    if (!given) throw py::error_already_set();
    if (given.ndim() == 0) {
        Points all(count);
        std::fill_n(all.mutable_data(), count, *given.data());
        return all;
    }
    if (given.ndim() == 1 && given.shape(0) == count) return given;
    throw py::value_error("depth has " + shape_text(given) + ", expected a number, (" +
                          std::to_string(count) + ",) or a map (h, w)");
}

bool is_map(const py::object& depth) {
    return py::isinstance<py::array>(depth) && py::array(depth).ndim() == 2;
}

FrameTransfer frame_of(const Rig& rig, const py::object& depth) {
    const Held held = depth_of("depth", depth);
    return unlocked([&] { return FrameTransfer(rig, held.view); });
}

Points transfer_points(const Rig& rig, const Points& points, const py::object& depth, bool beyond) {
    if (is_map(depth)) {
        const FrameTransfer frame = frame_of(rig, depth);
        return places_of(each(points, [&](const auto& p, auto) { return frame.to_source(p); }),
                         beyond);
    }
    rig.validate();
    const Points z = depths_of(depth, points.ndim() ? points.shape(0) : 0);
    const double* each_z = z.data();
    return places_of(
        each(points, [&](const auto& p, auto i) { return transfer(rig, p, each_z[i]); }), beyond);
}

Points transfer_points_back(const Rig& rig, const Points& points, const py::object& depth,
                            bool beyond) {
    if (is_map(depth)) {
        const FrameTransfer frame = frame_of(rig, depth);
        return places_of(each(points, [&](const auto& p, auto) { return frame.to_reference(p); }),
                         beyond);
    }
    rig.validate();
    const Points z = depths_of(depth, points.ndim() ? points.shape(0) : 0);
    const double* each_z = z.data();
    return places_of(
        each(points, [&](const auto& p, auto i) { return transfer_back(rig, p, each_z[i]); }),
        beyond);
}

}  // namespace

void bind_transfer(py::module_& m) {
    auto rig = py::class_<Rig>(m.attr("Rig"));
    rig.def("transfer", &transfer_points, py::arg("points"), py::arg("depth"),
            py::arg("beyond") = false,
            R"(Points (N, 2) of the reference image in the source image: (N, 2) [px].

depth: the frame's map (h, w) float32 [m], a number [m], or one of each point, (N,). NaN where
there is none: outside of the source image (beyond: only where the camera cannot see), or the depth
unknown. What the source sees something nearer in front of is given: FrameTransfer says so.)")
        .def("transfer_back", &transfer_points_back, py::arg("points"), py::arg("depth"),
             py::arg("beyond") = false,
             R"(Points (N, 2) of the source image in the reference image: (N, 2) [px].

depth: the frame's map (h, w) float32 [m] of the reference, or of each point its depth in the
reference camera, a number or (N,). With a map it is what is in front that counts. NaN where there
is none: outside of the reference image (beyond: given too where depth is a number), depth unknown,
or between a near and a far surface.)");

    py::class_<FrameTransfer>(
        m, "FrameTransfer",
        R"(Points from either image of a frame to the other, through its depth.

Codes are those of a mask: 0 valid, 1 outside (or nothing there that the reference shows), 2
occluded (the source sees something nearer; the point is given), 3 no depth, and 4 ambiguous
(between a near and a far surface).)")
        .def(py::init(&frame_of), py::arg("rig"), py::arg("depth"),
             "depth: (h, w) float32 [m], of any size of the reference's aspect, 0 unknown.")
        .def(
            "to_source",
            [](const FrameTransfer& frame, const Points& points) {
                return each(points, [&](const auto& p, auto) { return frame.to_source(p); });
            },
            py::arg("points"),
            "(points, depths, codes) of reference points (N, 2): (N, 2) [px], which lie beyond "
            "the image where they are outside; depth in the reference camera (N,) [m]; (N,) uint8.")
        .def(
            "to_reference",
            [](const FrameTransfer& frame, const Points& points) {
                return each(points, [&](const auto& p, auto) { return frame.to_reference(p); });
            },
            py::arg("points"), "The same of source points (N, 2); NaN where not valid.")
        .def(
            "inverse_map",
            [](const FrameTransfer& frame, int width, int height) {
                const std::vector<float> values = unlocked([&] { return frame.inverse_map(); });
                if (values.size() != 2 * std::size_t(width) * std::size_t(height))
                    throw py::value_error("the size is not that of the rig's source");
                return py::array_t<float>({height, width, 2}, values.data());
            },
            py::arg("width"), py::arg("height"),
            "(height, width, 2) float32 of the source's size: reference coordinates of each source "
            "pixel [px], NaN where there are none. The inverse of Registrar.map().");
}

}  // namespace xcalib

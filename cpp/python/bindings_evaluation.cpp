// How well a rig registers, what it says, and pictures of it.
#include <pybind11/stl.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "xcalib/judge/describe.hpp"
#include "xcalib/judge/evaluate.hpp"
#include "xcalib/judge/overlay.hpp"

namespace xcalib {
namespace {

py::dict dict_of(const Scores& scores) {
    py::dict out;
    for (std::size_t i = 0; i < scores.size(); ++i) out[kScoreNames[i]] = scores[i];
    return out;
}

// Images that are compared must have one size; `name` is the second's.
void require_mask(const py::array& mask, const ImageView& image) {
    if (mask.ndim() != 2 || mask.shape(0) != image.height || mask.shape(1) != image.width)
        throw py::value_error("mask has " + shape_text(mask) + ", expected the images' " +
                              std::to_string(image.width) + "x" + std::to_string(image.height));
}

}  // namespace

void bind_evaluation(py::module_& m) {
    py::class_<Evaluation>(m, "Evaluation", "Scores of the registered and the unregistered source.")
        .def_property_readonly(
            "size", [](const Evaluation& e) { return std::pair(e.width, e.height); },
            "Width and height the images are judged at [px].")
        .def_readonly("valid_share", &Evaluation::valid_share,
                      "Mean share of the pixels judged, [0, 1].")
        .def_property_readonly(
            "registered", [](const Evaluation& e) { return dict_of(e.registered); },
            "Scores by name, means over the frames; NaN where undefined.")
        .def_property_readonly(
            "unregistered", [](const Evaluation& e) { return dict_of(e.unregistered); },
            "The same of the source that is only resized.")
        .def_property_readonly(
            "gain_percent",
            [](const Evaluation& e) {
                Scores gains;
                for (std::size_t i = 0; i < gains.size(); ++i) gains[i] = e.gain(i);
                return dict_of(gains);
            },
            "Change of each score by registration [%], NaN where undefined.")
        .def_property_readonly(
            "frames",
            [](const Evaluation& e) {
                py::list frames;
                for (const auto& [registered, unregistered] : e.frames)
                    frames.append(py::make_tuple(dict_of(registered), dict_of(unregistered)));
                return frames;
            },
            "Registered and unregistered scores of each frame.")
        .def("table", &Evaluation::table, "The scores as text, one line each.");

    py::class_<Evaluator>(m, "Evaluator", "Judges a rig on frames, one by one.")
        .def(py::init<const Rig&, int, int>(), py::arg("rig"), py::arg("width") = 640,
             py::arg("num_threads") = 0,
             "width: the reference is reduced by the smallest integer that makes it at most this "
             "wide [px]. num_threads: 0 means all cores.")
        .def(
            "add",
            [](Evaluator& evaluator, const py::object& reference, const py::object& source,
               const py::object& depth) {
                const Held r = image_of("reference", reference), s = image_of("source", source);
                const Held d = depth_of("depth", depth);
                const py::gil_scoped_release unlocked;
                evaluator.add(r.view, s.view, d.view);
            },
            py::arg("reference"), py::arg("source"), py::arg("depth"),
            "Images of one size a camera, as Registrar takes them; depth (h, w) float32 [m].")
        .def("result", &Evaluator::result, "The Evaluation; ValueError without a frame.");

    m.def(
        "describe",
        [](const Rig& rig) {
            const RigFacts facts = describe(rig);
            py::list centre;
            for (const RigFacts::Centre& row : facts.centre)
                centre.append(py::dict(
                    py::arg("depth_m") = row.depth,
                    py::arg("point_px") = std::vector<double>{row.point.x(), row.point.y()},
                    py::arg("parallax_px") = row.parallax));
            return py::dict(py::arg("rotation_deg") = py::dict(py::arg("pan") = facts.pan_deg,
                                                               py::arg("tilt") = facts.tilt_deg,
                                                               py::arg("roll") = facts.roll_deg),
                            py::arg("position_m") =
                                std::vector<double>(facts.position.begin(), facts.position.end()),
                            py::arg("baseline_m") = facts.baseline, py::arg("centre") = centre);
        },
        py::arg("rig"),
        R"(What follows from the rig's parameters, in px, deg and m.

rotation_deg turns the source camera out of the reference camera's axes: pan to the right, then tilt
up, then roll clockwise. Parallax is the distance from the point at infinity.)");
    m.def("facts_text", &facts_text, py::arg("rig"), "describe() and the cameras, as lines.");

    m.def(
        "display_gray",
        [](const py::object& image) {
            const Held held = image_of("image", image);
            return py::array_t<std::uint8_t>({held.view.height, held.view.width},
                                             display_gray(held.view).data());
        },
        py::arg("image"),
        "Gray for the eye, (H, W) uint8: 1 to 99 % of the non-zero pixels stretched to 0 to 255.");
    m.def(
        "overlay",
        [](const py::object& reference, const py::object& registered, const py::object& valid) {
            const Held a = image_of("reference", reference), b = image_of("registered", registered);
            py::array_t<std::uint8_t, py::array::c_style | py::array::forcecast> mask;
            if (!valid.is_none()) {
                const py::array given = py::array::ensure(valid);
                require_mask(given, a.view);
                mask = py::module_::import("numpy").attr("not_equal")(given, 0);
            }
            return py::array_t<std::uint8_t>(
                {a.view.height, a.view.width, 3},
                overlay(a.view, b.view, valid.is_none() ? nullptr : mask.data()).data());
        },
        py::arg("reference"), py::arg("registered"), py::arg("valid") = py::none(),
        R"(Red-cyan composite (H, W, 3) uint8 of two images of one size: reference red, other cyan.

Where the other is not valid (mask (H, W), nonzero where it is) the reference alone is shown, in
gray.)");
}

}  // namespace xcalib

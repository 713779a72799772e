#include <pybind11/stl.h>

#include "arrays.hpp"
#include "base/format.hpp"
#include "bindings.hpp"
#include "json.hpp"
#include "xcalib/judge/evaluate.hpp"

namespace xcalib {
namespace {

void bind_evaluation(py::module_& m) {
    py::class_<Evaluation>(m, "Evaluation", "Scores of the registered and the unregistered source.")
        .def_property_readonly(
            "size", [](const Evaluation& e) { return std::pair(e.width, e.height); },
            "Width and height the images are judged at [px].")
        .def_readonly("valid_share", &Evaluation::valid_share,
                      "Mean share of the pixels judged, [0, 1].")
        .def_property_readonly(
            "registered", [](const Evaluation& e) { return object_of(json_of(e.registered)); },
            "Scores by name, means over the frames; NaN where undefined.")
        .def_property_readonly(
            "unregistered", [](const Evaluation& e) { return object_of(json_of(e.unregistered)); },
            "The same of the source that is only resized.")
        .def_property_readonly(
            "gain_percent",
            [](const Evaluation& e) { return object_of(json_of(e)["gain_percent"]); },
            "Change of each score by registration [%], NaN where undefined.")
        .def_property_readonly(
            "frames",
            [](const Evaluation& e) {
                py::list frames;
                for (const auto& [registered, unregistered] : e.frames)
                    frames.append(py::make_tuple(object_of(json_of(registered)),
                                                 object_of(json_of(unregistered))));
                return frames;
            },
            "Registered and unregistered scores of each frame.")
        .def_property_readonly(
            "given",
            [](const Evaluation& e) -> py::object {
                if (!e.given) return py::none();
                return object_of(json_of(*e.given));
            },
            "The same of images that another method registered, or None.")
        .def("__repr__",
             [](const Evaluation& e) {
                 return format(
                     "Evaluation(%zu frames, %.1f %% valid; NEC %.4f, %.4f without;"
                     " GC %.4f, %.4f without)",
                     e.frames.size(), 100 * e.valid_share, e.registered[0], e.unregistered[0],
                     e.registered[1], e.unregistered[1]);
             })
        .def_readonly("verdict", &Evaluation::verdict,
                      "Verdict of the rig on these frames, or None where it was not asked for, or "
                      "where no two frames can be judged.")
        .def("table", &Evaluation::table, "The scores as text, one line each.")
        .def("verdict_line", &Evaluation::verdict_line, "The verdict on these frames.")
        .def("difference", &Evaluation::difference, py::arg("rig"), py::arg("rig_file"),
             "A line where that of the rig's file differs, else ''.");
}

}  // namespace

void bind_evaluate(py::module_& m) {
    bind_evaluation(m);
    py::class_<Evaluator>(m, "Evaluator", "Judges a rig on frames, one by one.")
        .def(py::init<const Rig&, int, int>(), py::arg("rig"), py::arg("width") = 640,
             py::arg("num_threads") = 0,
             "width: the reference is reduced by the smallest integer that makes it at most this "
             "wide [px]. num_threads: 0 means all cores.")
        .def(
            "add",
            [](Evaluator& evaluator, const py::object& reference, const py::object& source,
               const py::object& depth, const py::object& given) {
                const Held r = image_of("reference", reference), s = image_of("source", source);
                const Held d = depth_of("depth", depth);
                const Held g = given.is_none() ? Held{} : image_of("given", given);
                const py::gil_scoped_release released;
                evaluator.add(r.view, s.view, d.view, given.is_none() ? nullptr : &g.view);
            },
            py::arg("reference"), py::arg("source"), py::arg("depth"),
            py::arg("given") = py::none(),
            "Images of one size a camera, as Registrar takes them; depth (h, w) float32 [m]. "
            "given: "
            "the source as another method registers it, of the reference's aspect.")
        .def("result", &Evaluator::result, py::arg("judge") = false,
             py::call_guard<py::gil_scoped_release>(),
             "The Evaluation; ValueError without a frame. judge: with the verdict of the rig on a "
             "dozen of these frames, which takes seconds.");
}

}  // namespace xcalib

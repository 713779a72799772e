#include <pybind11/functional.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "from_python.hpp"
#include "xcalib/stream/straightened.hpp"

namespace xcalib {
namespace {

// A function of two (H, W) uint8 images that gives (H, W, 2) float32.
EstimateMotion motion_of(const py::function& estimate) {
    const Kept function = kept(estimate);
    return [function](const ImageView& from, const ImageView& to) {
        return in_python([&] {
            const auto array = [](const ImageView& view) {
                return py::array_t<std::uint8_t>({view.height, view.width},
                                                 static_cast<const std::uint8_t*>(view.data));
            };
            const py::array_t<float, py::array::c_style | py::array::forcecast> flow =
                (*function)(array(from), array(to));
            if (flow.ndim() != 3 || flow.shape(0) != from.height || flow.shape(1) != from.width ||
                flow.shape(2) != 2)
                throw py::value_error("the motion is " + shape_text(flow) + ", expected (" +
                                      std::to_string(from.height) + ", " +
                                      std::to_string(from.width) + ", 2)");
            Motion motion{Image(from.width, from.height), Image(from.width, from.height)};
            for (std::size_t i = 0; i < motion.x.pixels.size(); ++i) {
                motion.x.pixels[i] = flow.data()[2 * i];
                motion.y.pixels[i] = flow.data()[2 * i + 1];
            }
            return motion;
        });
    };
}

}  // namespace

void bind_straightened(py::module_& m) {
    m.def("parse_readout", &parse_readout, py::arg("option"), py::arg("text"),
          "The share, 0 to 1, that an option says; None for 'auto'. Raises InputError.");
    m.def(
        "straightened",
        [](const StreamPointer& sources, double source, double reference,
           const std::optional<Rig>& rig, const py::function& motion, bool nearest) {
            const EstimateMotion estimate = motion_of(motion);
            const py::gil_scoped_release released;
            return straightened(sources, {source, reference}, rig, estimate, nearest);
        },
        py::arg("sources"), py::arg("source"), py::arg("reference"), py::arg("rig").none(true),
        py::arg("motion"), py::arg("nearest") = false,
        R"(Source frames whose rows are brought to the time of the reference's, as they are read.

source, reference: from the first row's reading to the last one's, in shares of the time from frame
to frame; both 0 give the stream itself. rig: which rows look the same way; None: the rows of both,
upright. motion: a function of two (H, W) uint8 frames that gives (H, W, 2) float32 [px], where what
the first shows stands in the second. nearest: pixels are taken as they are, else cubic. Raises
InputError where the frames do not follow each other.)");
    py::class_<ReadoutFit>(m, "ReadoutFit", "What fit_readout() found.")
        .def_readonly("share", &ReadoutFit::share, "Of the time from frame to frame.")
        .def_property_readonly("taken", &ReadoutFit::taken, "To give to the option: at most 1.")
        .def_readonly("error", &ReadoutFit::error, "Standard error of the share.")
        .def_readonly("seen", &ReadoutFit::seen, "Whether there is one, and not by chance.")
        .def_readonly("shares", &ReadoutFit::shares, "That were tried.")
        .def_readonly("nec", &ReadoutFit::nec, "Of each frame at each of the shares.")
        .def("line", &ReadoutFit::line, py::arg("camera"), "In words.");
    m.def(
        "fit_readout",
        [](const py::sequence& references, const py::sequence& depths, std::vector<int> partners,
           const StreamPointer& all_sources, const Rig& rig, const CalibrationOptions& options,
           double source, double reference, bool of_reference, const py::function& motion,
           const std::function<void(double)>& progress) {
            const HeldList r = list_of("reference", references, image_of);
            const HeldList d = list_of("depth", depths, metric_depth_of);
            const EstimateMotion estimate = motion_of(motion);
            const py::gil_scoped_release released;
            return fit_readout({r.views, {}, d.views, std::move(partners)}, all_sources, rig,
                               options, {source, reference}, of_reference, estimate, progress);
        },
        py::arg("references"), py::arg("depths"), py::arg("partners"), py::arg("all_sources"),
        py::arg("rig"), py::arg("options"), py::arg("source"), py::arg("reference"),
        py::arg("of_reference"), py::arg("motion"), py::arg("progress"),
        R"(The readout of a camera, as the fit of rig to a dozen of the frames shows it.

partners: the indices of their sources in all_sources, as they were read. source, reference: what is
known of the readouts; what is found comes to that of the source, or of the reference if of_reference.
)");
}

}  // namespace xcalib

#include "arrays.hpp"
#include "bindings.hpp"
#include "xcalib/footage/flir.hpp"

namespace xcalib {

void bind_flir(py::module_& m) {
    py::class_<FlirParts>(m, "FlirParts", "What a radiometric JPEG of a FLIR camera has in it.")
        .def_property_readonly(
            "thermal", [](const FlirParts& parts) { return py::bytes(parts.thermal); },
            "The counts, uint16: an image file, or plain, row by row.")
        .def_readonly("width", &FlirParts::width, "Of the counts [px].")
        .def_readonly("height", &FlirParts::height, "Of the counts [px].")
        .def_readonly("is_file", &FlirParts::is_file, "Whether the counts are an image file.")
        .def_readonly("big_endian", &FlirParts::big_endian,
                      "The counts' order of bytes; in a PNG, that they are the wrong way.")
        .def_property_readonly(
            "visible", [](const FlirParts& parts) { return py::bytes(parts.visible); },
            "An image file; empty where there is none.")
        .def_readonly("real_to_ir", &FlirParts::real_to_ir,
                      "Ratio of the fields of view, as the camera lays its images over each other.")
        .def_readonly("offset_x", &FlirParts::offset_x,
                      "Of the thermal image from the visible one's middle [px of it].")
        .def_readonly("offset_y", &FlirParts::offset_y, "The same, down.")
        .def(
            "alignment",
            [](const FlirParts& parts, const std::string& name) {
                return flir_alignment(parts, name);
            },
            py::arg("name"),
            "The rig that the camera's own alignment is: a start, with a reference of 45 deg of"
            " field of view. InputError, naming `name`, where the file does not say.")
        .def(
            "celsius",
            [](const FlirParts& parts, const py::object& counts) -> py::object {
                if (!parts.planck) return py::none();
                const Held held = image_of("counts", counts);
                if (held.view.type != PixelType::u16 || held.view.channels != 1)
                    throw py::value_error("counts are not uint16 (H, W)");
                return array_of(celsius_of(held.view, *parts.planck));
            },
            py::arg("counts"),
            "(H, W) float32, degrees Celsius of a black body; None where the file does not say.");
    m.def(
        "flir_parts",
        [](const std::string& data, const std::string& name) {
            return unlocked([&] { return flir_parts(data, name); });
        },
        py::arg("data"), py::arg("name"),
        "FlirParts of a JPEG, or None where it is not radiometric. DecodeError where damaged.");
    m.def(
        "plain_counts",
        [](const FlirParts& parts) {
            FlirParts right = parts;
            put_counts_right(right);
            py::array_t<std::uint16_t> out({right.height, right.width});
            std::copy(right.thermal.begin(), right.thermal.end(),
                      reinterpret_cast<char*>(out.mutable_data()));
            return out;
        },
        py::arg("parts"), "(H, W) uint16 of counts that are no image file.");
}

}  // namespace xcalib

#include "arrays.hpp"

#include <limits>

namespace xcalib {
namespace {

std::string type_name(const py::object& object) {
    return py::str(py::type::of(object).attr("__name__"));
}

bool is_path(const py::object& object) {
    return py::isinstance<py::str>(object) || py::isinstance<py::bytes>(object) ||
           py::hasattr(object, "__fspath__");
}

// What was given in place of an array, as people do.
[[noreturn]] void refuse(const std::string& name, const py::object& object,
                         const std::string& expected) {
    if (object.is_none())
        throw py::value_error(name + " is None, expected " + expected +
                              "; cv2.imread returns None for a file that it cannot read");
    if (is_path(object))
        throw py::value_error(name + " is the path " + std::string(py::repr(object)) +
                              ", expected " + expected +
                              "; xcalib.frames.read_image and xcalib.depth.read_depth read files");
    throw py::value_error(name + " is a " + type_name(object) + ", expected " + expected);
}

bool is_masked(const py::object& object) {
    return py::hasattr(object, "mask") && py::hasattr(object, "filled");
}

// An array of the machine's own byte order, floats as float32, without a mask: masked pixels have
// the value `unknown`.
py::array plain_array(const std::string& name, const py::object& object,
                      const std::string& expected, float unknown) {
    if (object.is_none() || is_path(object) || py::isinstance<py::dict>(object))
        refuse(name, object, expected);
    py::array given = py::array::ensure(object);
    if (!given || given.dtype().kind() == 'O') {
        PyErr_Clear();
        refuse(name, object, expected);
    }
    if (!given.dtype().attr("isnative").cast<bool>())
        given = given.attr("astype")(given.dtype().attr("newbyteorder")("="));
    if (given.dtype().kind() == 'f' && !py::isinstance<py::array_t<float>>(given))
        given = py::array_t<float>::ensure(given);
    if (!is_masked(object)) return given;
    const py::module_ numpy = py::module_::import("numpy");
    const py::array mask = numpy.attr("ma").attr("getmaskarray")(object);
    if (!mask.attr("any")().cast<bool>()) return given;
    if (given.dtype().kind() != 'f' && unknown != 0)
        throw py::value_error(
            name + " has masked pixels and dtype " + std::string(py::str(given.dtype())) +
            ", which has no value for them; expected float32, where they are NaN");
    return numpy.attr("where")(mask, given.dtype().attr("type")(unknown), given);
}

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
const char* const kImage = "an array (H, W) or (H, W, 3) of uint8, uint16 or float32";

Held image_of_array(const std::string& name, const py::array& given) {
    PixelType type;
    if (py::isinstance<py::array_t<std::uint8_t>>(given)) type = PixelType::u8;
    else if (py::isinstance<py::array_t<std::uint16_t>>(given)) type = PixelType::u16;
    else if (py::isinstance<py::array_t<float>>(given)) type = PixelType::f32;
    else
        throw py::value_error(name + " has " + shape_text(given) +
                              ", expected dtype uint8, uint16 or float32");
    const bool gray = given.ndim() == 2 || (given.ndim() == 3 && given.shape(2) == 1);
    if (!gray && !(given.ndim() == 3 && given.shape(2) == 3)) {
        const bool alpha = given.ndim() == 3 && given.shape(2) == 4;
        throw py::value_error(name + " has " + shape_text(given) +
                              ", expected shape (H, W) or (H, W, 3)" +
                              (alpha ? "; image[..., :3] drops the alpha channel" : ""));
    }
    if (given.size() == 0) throw py::value_error(name + " has " + shape_text(given) + ", is empty");
    Held held;
    held.array = py::array::ensure(given, py::array::c_style | kAligned);
    held.view = {
        held.array.data(),
        static_cast<int>(held.array.shape(1)),
        static_cast<int>(held.array.shape(0)),
        gray ? 1 : 3,
        type,
        static_cast<std::ptrdiff_t>(held.array.shape(1) * (gray ? 1 : 3) * held.array.itemsize())};
    return held;
}

// One value a pixel of an image of this size.
py::array map_of(const std::string& name, const py::object& object, int width, int height) {
    const py::array given = py::array::ensure(object);
    if (!given || given.ndim() != 2 || given.shape(0) != height || given.shape(1) != width)
        throw py::value_error(name + " has " + (given ? shape_text(given) : "no shape") +
                              ", expected the images' " + std::to_string(width) + "x" +
                              std::to_string(height));
    return given;
}

}  // namespace

std::string shape_text(const py::array& array) {
    std::string text = "shape (";
    for (py::ssize_t i = 0; i < array.ndim(); ++i)
        text += (i ? ", " : "") + std::to_string(array.shape(i));
    return text + ") " + std::string(py::str(array.dtype()));
}

Held image_of(const std::string& name, const py::object& object) {
    return image_of_array(name, plain_array(name, object, kImage, kNaN));
}

Held depth_of(const std::string& name, const py::object& object, bool unit_known) {
    const py::array given = plain_array(name, object, "an array (h, w) float32 in metres", 0);
    const bool is_counts = py::isinstance<py::array_t<std::uint16_t>>(given);
    const bool is_depth = py::isinstance<py::array_t<float>>(given) || (unit_known && is_counts);
    if (is_depth && given.ndim() == 2 && given.size() > 0) return image_of_array(name, given);
    std::string message =
        name + " has " + shape_text(given) + ", expected shape (h, w) float32 in metres";
    if (is_counts && !unit_known)
        message +=
            "; counts have no unit: Registrar(rig, depth_scale=1 / 256) takes KITTI's, 0.001 "
            "millimetres, and depth * np.float32(0.001) makes metres of them";
    throw py::value_error(message);
}

py::sequence frames_of(const std::string& name, const py::object& frames) {
    const std::string expected = ", expected a list of images, one a frame";
    if (frames.is_none()) throw py::type_error(name + "s is None" + expected);
    if (is_path(frames))
        throw py::type_error(name + "s is the path " + std::string(py::repr(frames)) + expected +
                             "; xcalib.footage.open_stream opens a folder or a video");
    if (py::isinstance<py::array>(frames)) {
        const auto array = py::reinterpret_borrow<py::array>(frames);
        const bool colour = array.ndim() == 3 && array.shape(2) <= 4 && array.shape(1) > 4;
        if (array.ndim() < 3 || colour)
            throw py::type_error(name + "s is one array of " + shape_text(array) + expected);
    }
    if (py::isinstance<py::sequence>(frames)) return frames;
    if (py::isinstance<py::dict>(frames) || !py::hasattr(frames, "__iter__"))
        throw py::type_error(name + "s is a " + type_name(frames) + expected);
    return py::list(frames);
}

HeldMask valid_of(const py::object& valid, int width, int height) {
    HeldMask held;
    if (valid.is_none()) return held;
    const py::array given = map_of("valid", valid, width, height);
    held.array = py::module_::import("numpy").attr("not_equal")(given, 0);
    held.data = held.array.data();
    return held;
}

HeldMask mask_of(const py::object& mask, int width, int height) {
    HeldMask held;
    if (mask.is_none()) return held;
    const char* const expected =
        "expected the registrar's: 0 where valid, 1 to 3 where not, as np.where(valid, 0, 1)";
    const py::array given = map_of("mask", mask, width, height);
    const char kind = given.dtype().kind();
    if (kind != 'u' && kind != 'i')
        throw py::value_error("mask is " + std::string(py::str(given.dtype())) + ", " + expected);
    const py::object largest = given.attr("max")(), smallest = given.attr("min")();
    if (largest.cast<double>() > 3 || smallest.cast<double>() < 0)
        throw py::value_error(
            "mask has the value " +
            std::string(py::str(largest.cast<double>() > 3 ? largest : smallest)) + ", " +
            expected);
    held.array = py::module_::import("numpy").attr("equal")(given, 0);
    held.data = held.array.data();
    return held;
}

}  // namespace xcalib

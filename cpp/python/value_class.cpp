#include "value_class.hpp"

#include "base/format.hpp"

namespace xcalib {
namespace {

bool is_list(const py::object& value) {
    return py::isinstance<py::list>(value) || py::isinstance<py::tuple>(value);
}

// One of ours that is pickled by its state.
bool is_value(const py::object& value) { return py::hasattr(py::type::of(value), "__setstate__"); }

}  // namespace

std::string exact_text(const py::object& value) {
    if (is_list(value)) {
        std::string text = "[";
        for (const py::handle item : value)
            text += exact_text(py::reinterpret_borrow<py::object>(item)) + ", ";
        return text + "]";
    }
    if (is_value(value)) return exact_text(value.attr("__getstate__")());
    return py::repr(value);
}

std::string brief_text(const py::object& value) {
    if (py::isinstance<py::float_>(value)) return format("%.6g", value.cast<double>());
    if (!is_list(value)) return py::repr(value);
    const auto count = py::len(value);
    if (count > 0 && is_value(value[py::int_(0)])) {
        const std::string type =
            py::str(py::type::of(py::object(value[py::int_(0)])).attr("__name__"));
        return "[" + std::to_string(count) + " " + type + "]";
    }
    std::string text;
    for (const py::handle item : value)
        text += (text.empty() ? "" : ", ") + brief_text(py::reinterpret_borrow<py::object>(item));
    return "[" + text + "]";
}

void refuse_option(const std::string& owner, const std::string& name,
                   const std::vector<std::string>& known) {
    const py::list close = py::module_::import("difflib").attr("get_close_matches")(name, known, 1);
    std::string text = owner + ": unknown option '" + name + "', ";
    if (py::len(close)) {
        text += "did you mean '" + close[0].cast<std::string>() + "'?";
    } else {
        text += "expected one of";
        for (const std::string& each : known) text += (&each == &known.front() ? " " : ", ") + each;
    }
    throw py::type_error(text);
}

}  // namespace xcalib

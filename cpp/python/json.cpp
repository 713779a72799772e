#include "json.hpp"

namespace xcalib {

namespace py = pybind11;

py::object object_of(const Json& json) {
    if (json.is_object()) {
        py::dict out;
        for (const auto& [key, value] : json.items()) out[py::str(key)] = object_of(value);
        return out;
    }
    if (json.is_array()) {
        py::list out;
        for (const Json& value : json) out.append(object_of(value));
        return out;
    }
    if (json.is_string()) return py::str(json.get<std::string>());
    if (json.is_boolean()) return py::bool_(json.get<bool>());
    if (json.is_number_float()) return py::float_(json.get<double>());
    if (json.is_number()) return py::int_(json.get<std::int64_t>());
    return py::none();
}

}  // namespace xcalib

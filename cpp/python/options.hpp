// Options as Python has them: set by keyword arguments, with words in place of enumerations.
#pragma once

#include <pybind11/pybind11.h>

#include <string>

#include "xcalib/option_words.hpp"

namespace xcalib {

namespace py = pybind11;

// Sets the fields that keyword arguments name; an unknown one is an error.
template <class Options>
Options options_from(const py::kwargs& fields) {
    const py::object object = py::cast(Options{});
    for (const auto& [name, value] : fields) {
        if (!py::hasattr(object, name))
            throw py::type_error("unknown option '" + std::string(py::str(name)) + "'");
        py::setattr(object, name, value);
    }
    return object.cast<Options>();
}

// A property that is the word of a field; `label` is what messages call it.
template <class Options, class Value>
void def_word(py::class_<Options>& owner, const char* name, Value Options::*field,
              const char* label, const char* doc) {
    owner.def_property(
        name, [field](const Options& options) { return word_of(options.*field); },
        [field, label](Options& options, const std::string& word) {
            options.*field = value_of<Value>(label, word);
        },
        doc);
}

}  // namespace xcalib

// Classes of plain values: checked when they are set, compared, copied, pickled and shown by their
// fields.
#pragma once

#include <functional>
#include <memory>
#include <sstream>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "bindings.hpp"
#include "xcalib/option_words.hpp"

namespace xcalib {

namespace py = pybind11;

// What equal values have in common, whatever NaN says of itself: the state that they are pickled
// by, as text.
std::string exact_text(const py::object& value);

// A value in a few characters: numbers by six digits, lists of objects by their length.
std::string brief_text(const py::object& value);

// Raises TypeError: an option that there is not, and those that it may have meant.
[[noreturn]] void refuse_option(const std::string& owner, const std::string& name,
                                const std::vector<std::string>& known);

// As copy and pickle want it, of a class that has a copy constructor and is pickled already.
template <class Class>
void def_copies(Class& owner) {
    using Value = typename Class::type;
    owner.def("__copy__", [](const Value& value) { return Value(value); })
        .def(
            "__deepcopy__", [](const Value& value, const py::dict&) { return Value(value); },
            py::arg("memo"))
        .def(
            "__eq__",
            [](const py::object& self, const py::object& other) -> py::object {
                if (!py::isinstance<Value>(other))
                    return py::reinterpret_borrow<py::object>(Py_NotImplemented);
                return py::bool_(exact_text(self) == exact_text(other));
            },
            py::is_operator());
    // What may change has no place in a set.
    owner.attr("__hash__") = py::none();
}

// Throws where the value is not valid, of those that can tell.
template <class Value, class = void>
struct Checked {
    static void check(const Value&, const char*) {}
};
template <class Value>
struct Checked<Value, std::void_t<decltype(std::declval<const Value&>().validate())>> {
    static void check(const Value& value, const char*) { value.validate(); }
};
template <class Value>
struct Checked<Value, std::void_t<decltype(std::declval<const Value&>().validate(""))>> {
    static void check(const Value& value, const char* name) { value.validate(name); }
};

// A py::class_ that knows the fields of its values; `as_value()` comes after the last one.
template <class Value, class... More>
class ValueClass : public py::class_<Value, More...> {
    using Base = py::class_<Value, More...>;

   public:
    ValueClass(py::module_& m, const char* name, const char* doc)
        : Base(m, name, doc), name_(name) {}

    template <class... Arguments>
    ValueClass& def(Arguments&&... arguments) {
        Base::def(std::forward<Arguments>(arguments)...);
        return *this;
    }
    template <class... Arguments>
    ValueClass& def_static(Arguments&&... arguments) {
        Base::def_static(std::forward<Arguments>(arguments)...);
        return *this;
    }
    template <class... Arguments>
    ValueClass& def_property_readonly(Arguments&&... arguments) {
        Base::def_property_readonly(std::forward<Arguments>(arguments)...);
        return *this;
    }

    template <class Field>
    ValueClass& def_readonly(const char* name, Field Value::*field, const char* doc) {
        Base::def_readonly(name, field, doc);
        return keep(name, field);
    }
    template <class Field>
    ValueClass& def_readwrite(const char* name, Field Value::*field, const char* doc) {
        Base::def_property(
            name, [field](const Value& value) -> const Field& { return value.*field; },
            [field, owner = name_](Value& value, const Field& set) {
                Value changed = value;
                changed.*field = set;
                Checked<Value>::check(changed, owner);
                value = std::move(changed);
            },
            doc);
        return keep(name, field);
    }
    // A field that Python sees as something else.
    template <class Get, class Set>
    ValueClass& def_seen(const char* name, const Get& get, const Set& set, const char* doc) {
        const auto checked = [set, owner = name_](Value& value, const std::string& text) {
            Value changed = value;
            set(changed, text);
            Checked<Value>::check(changed, owner);
            value = std::move(changed);
        };
        Base::def_property(name, get, checked, doc);
        fields_->push_back({name, [get](const Value& value) { return py::cast(get(value)); },
                            [set](Value& value, const py::object& kept) {
                                set(value, kept.cast<std::string>());
                            }});
        return *this;
    }
    // A field by the word of its value; `label` is what messages call it.
    template <class Field>
    ValueClass& def_word(const char* name, Field Value::*field, const char* label,
                         const char* doc) {
        return def_seen(
            name, [field](const Value& value) { return std::string(word_of(value.*field)); },
            [field, label](Value& value, const std::string& word) {
                value.*field = value_of<Field>(label, word);
            },
            doc);
    }
    // A field that goes with the value, and is not seen: plain memory.
    template <class Field>
    ValueClass& keep_unseen(Field Value::*field) {
        static_assert(std::is_trivially_copyable_v<Field>);
        fields_->push_back({"",
                            [field](const Value& value) -> py::object {
                                return py::bytes(reinterpret_cast<const char*>(&(value.*field)),
                                                 sizeof(Field));
                            },
                            [field](Value& value, const py::object& kept) {
                                const auto bytes = kept.cast<std::string>();
                                if (bytes.size() == sizeof(Field))
                                    std::copy(bytes.begin(), bytes.end(),
                                              reinterpret_cast<char*>(&(value.*field)));
                            }});
        return *this;
    }

    // A field that goes with the value as something that Python can pickle, and is seen elsewhere.
    ValueClass& keep_as(std::function<py::object(const Value&)> get,
                        std::function<void(Value&, const py::object&)> set) {
        fields_->push_back({"", std::move(get), std::move(set)});
        return *this;
    }

    // A constructor that sets fields by keyword arguments, checked when all are set. The fields
    // may be defined after it.
    ValueClass& def_options() {
        return def(py::init([fields = fields_, name = name_](const py::kwargs& given) {
            Value value{};
            for (const auto& [key, item] : given) {
                const auto object = py::reinterpret_borrow<py::object>(item);
                set_field(*fields, name, key.template cast<std::string>(), object, value);
            }
            Checked<Value>::check(value, name);
            return value;
        }));
    }

    void as_value(bool has_text = false) {
        const auto fields = fields_;
        this->def(py::pickle(
            [fields](const Value& value) {
                py::list state;
                for (const Field& field : *fields) state.append(field.get(value));
                return py::tuple(state);
            },
            [fields, name = name_](const py::tuple& state) {
                if (state.size() != fields->size())
                    throw py::value_error(std::string(name) + ": pickled by another version");
                Value value{};
                for (std::size_t i = 0; i < fields->size(); ++i) (*fields)[i].set(value, state[i]);
                return value;
            }));
        def_copies(*this);
        if (has_text) return;
        this->def("__repr__", [fields, name = name_](const Value& value) {
            const Value usual{};
            std::string text;
            for (const Field& field : *fields) {
                const py::object here = field.get(value);
                if (*field.name && exact_text(here) != exact_text(field.get(usual)))
                    text += (text.empty() ? "" : ", ") + std::string(field.name) + "=" +
                            brief_text(here);
            }
            return std::string(name) + "(" + text + ")";
        });
    }

   private:
    struct Field {
        const char* name;
        std::function<py::object(const Value&)> get;
        std::function<void(Value&, const py::object&)> set;
    };

    static void set_field(const std::vector<Field>& fields, const char* owner,
                          const std::string& name, const py::object& given, Value& value) {
        std::vector<std::string> names;
        for (const Field& field : fields) {
            if (!*field.name) continue;
            if (name != field.name) {
                names.push_back(field.name);
                continue;
            }
            try {
                field.set(value, given);
            } catch (const py::cast_error&) {
                py::setattr(py::cast(Value{}), field.name, given);  // which says what was expected
                throw;
            }
            return;
        }
        refuse_option(owner, name, names);
    }

    template <class Type>
    ValueClass& keep(const char* name, Type Value::*field) {
        fields_->push_back(
            {name, [field](const Value& value) { return py::cast(value.*field); },
             [field](Value& value, const py::object& kept) { value.*field = kept.cast<Type>(); }});
        return *this;
    }

    const char* name_;
    std::shared_ptr<std::vector<Field>> fields_ = std::make_shared<std::vector<Field>>();
};

}  // namespace xcalib

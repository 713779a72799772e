// What Python implements for the core, called by threads that need not have Python's lock.
#pragma once

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "pictures.hpp"
#include "xcalib/error.hpp"
#include "xcalib/stream/frames.hpp"

namespace xcalib {

// Calls into Python, with its lock. What it raises is carried to the caller as it is, but for the
// errors that the core itself looks at.
template <class Call>
auto in_python(const Call& call) {
    const py::gil_scoped_acquire locked;
    try {
        return call();
    } catch (const py::error_already_set& error) {
        const py::module_ core = py::module_::import("xcalib._core");
        const auto text = [&error] { return py::str(error.value()).cast<std::string>(); };
        if (error.matches(core.attr("DecodeError"))) throw DecodeError(text());
        if (error.matches(core.attr("InputError"))) throw InputError(text());
        throw;
    }
}

class PythonDepth : public Depth {
   public:
    explicit PythonDepth(py::object provider)
        : concurrent_(provider.attr("is_parallel").cast<bool>()),
          steadied_(provider.attr("is_steady").cast<bool>()),
          looks_(provider.attr("looks_at_reference").cast<bool>()),
          provider_(kept(std::move(provider))) {}

    Picture operator()(int index, const Picture& reference) override {
        return in_python([&] {
            return picture_of(depth_of("depth", (*provider_)(index, array_of(reference))));
        });
    }
    std::vector<std::filesystem::path> files(int index) const override {
        return in_python([&] {
            return provider_->attr("files_of")(index).cast<std::vector<std::filesystem::path>>();
        });
    }
    bool concurrent() const override { return concurrent_; }
    bool steadied() const override { return steadied_; }
    bool looks_at_reference() const override { return looks_; }

   private:
    bool concurrent_, steadied_, looks_;
    Kept provider_;
};

}  // namespace xcalib

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "bindings.hpp"
#include "from_python.hpp"
#include "xcalib/footage/exif.hpp"
#include "xcalib/stream/oriented.hpp"
#include "xcalib/stream/stream.hpp"

namespace xcalib {

using Unlocked = py::call_guard<py::gil_scoped_release>;
namespace {

using Path = std::filesystem::path;

class PythonStream : public Stream, public py::trampoline_self_life_support {
   public:
    int size() const override {
        return in_python(
            [&]() -> int { PYBIND11_OVERRIDE_PURE_NAME(int, Stream, "__len__", size, ); });
    }
    std::string name(int index) const override {
        return in_python(
            [&]() -> std::string { PYBIND11_OVERRIDE_PURE(std::string, Stream, name, index); });
    }
    std::string where(int index) const override {
        return in_python(
            [&]() -> std::string { PYBIND11_OVERRIDE_PURE(std::string, Stream, where, index); });
    }
    Path file(int index) const override {
        return in_python([&]() -> Path { PYBIND11_OVERRIDE(Path, Stream, file, index); });
    }
    std::vector<Path> paths() const override {
        return in_python([&] {
            return py::getattr(self(), "paths", py::list()).template cast<std::vector<Path>>();
        });
    }
    bool concurrent() const override {
        return in_python([&] {
            // An attribute of the class, in place of the base's property.
            const py::object parallel = py::type::of(self()).attr("parallel");
            return py::isinstance<py::bool_>(parallel) && parallel.cast<bool>();
        });
    }
    std::optional<HeaderSize> size_in_header(int index) override {
        // By a path where frames are files of their own: read without Python's lock.
        const std::optional<Path> file = in_python([&]() -> std::optional<Path> {
            const py::object of = py::getattr(self(), "header_file", py::none());
            if (of.is_none()) return std::nullopt;
            return of(index).template cast<Path>();
        });
        return file ? header_size(*file) : std::nullopt;
    }

   private:
    py::object self() const {
        return py::cast(static_cast<const Stream*>(this), py::return_value_policy::reference);
    }
    Picture read(int index) override {
        return in_python(
            [&]() -> Picture { PYBIND11_OVERRIDE_PURE(Picture, Stream, read, index); });
    }
};

py::object times_of(const Stream& stream) {
    if (!stream.times) return py::none();
    return py::array_t<double>(static_cast<py::ssize_t>(stream.times->size()),
                               stream.times->data());
}

// A frame by its index, or the stream of those of a slice.
py::object item_of(const StreamPointer& stream, const py::object& item) {
    const int size = stream->size();
    if (py::isinstance<py::slice>(item)) {
        py::ssize_t start = 0, stop = 0, step = 0, length = 0;
        if (!item.cast<py::slice>().compute(size, &start, &stop, &step, &length))
            throw py::error_already_set();
        std::vector<int> indices;
        for (py::ssize_t i = 0; i < length; ++i)
            indices.push_back(static_cast<int>(start + i * step));
        return py::cast(
            std::static_pointer_cast<Stream>(std::make_shared<Picked>(stream, std::move(indices))));
    }
    int index = item.cast<int>();
    if (index < -size || index >= size)
        throw py::index_error("frame " + std::to_string(index) + " of " + std::to_string(size));
    if (index < 0) index += size;
    return array_of(unlocked([&] { return (*stream)[index]; }));
}

}  // namespace

void bind_stream(py::module_& m) {
    py::class_<Stream, PythonStream, py::smart_holder>(
        m, "Stream",
        R"(A sized sequence of frames, each read at the moment of access, all of one size.

Only names and times are held, so that memory does not grow with the pixels of the footage. A slice
is a stream again. A class of streams calls super().__init__() and has __len__, name(index),
where(index) and read(index): frame 0 <= index < len, (H, W) or (H, W, 3), uint8, uint16 or float32;
file(index) where that is not where(index); header_file(index) too where a frame is an image file as
it is stored, so that its size is known without decoding it; and parallel = True if several threads
may read.)")
        .def(py::init<>())
        .def("__len__", &Stream::size)
        .def("__getitem__", &item_of)
        .def("__iter__",
             [](const py::object& stream) {
                 return py::reinterpret_steal<py::object>(PySeqIter_New(stream.ptr()));
             })
        .def("name", &Stream::name, py::arg("index"),
             "What a file made from the frame is called, without suffix.")
        .def("where", &Stream::where, py::arg("index"),
             "Where the frame is, for messages: a file, or a file and the frame's number.")
        .def("file", &Stream::file, py::arg("index"),
             "The file that the frame is in, or the folder of a bag.")
        .def_property_readonly("parallel", &Stream::concurrent,
                               "Whether several threads may read at a time.")
        .def_property(
            "times", &times_of,
            [](Stream& stream, std::optional<std::vector<double>> times) {
                stream.times = std::move(times);
            },
            "(N,) seconds of the frames, never falling; None where unknown. Each stream has its "
            "clock.")
        .def_readwrite("said", &Stream::said,
                       "For the user: what of it was not used, or is missing, in a line, or ''.");
    py::class_<Picked, Stream, py::smart_holder>(m, "Picked", "Some frames of a stream, in order.")
        .def(py::init<StreamPointer, std::vector<int>>(), py::arg("stream"), py::arg("indices"));
    py::class_<Half, Stream, py::smart_holder>(
        m, "Half",
        "A half of every frame: two cameras side by side, or one above the other, in one stream.")
        .def(py::init<StreamPointer, std::string>(), py::arg("stream"), py::arg("half"),
             "half: left, right, top or bottom.");
    m.def(
        "header_size",
        [](const Path& file) -> std::optional<std::pair<int, int>> {
            const std::optional<HeaderSize> size = header_size(file);
            if (!size) return std::nullopt;
            return std::pair{size->width, size->height};
        },
        py::arg("file"),
        "(width, height) of a PNG or JPEG file by its header; None of others, and where it is not "
        "whole.");
    m.def(
        "times_beside",
        [](const std::vector<Path>& files, Stream& stream) {
            return times_beside(files, stream, stream.said);
        },
        py::arg("files"), py::arg("stream"), Unlocked(),
        "Times of timestamps.csv or timestamps.txt beside the files of a stream, None where there "
        "is "
        "none; a table without names that has more or fewer lines is not used, and stream.said "
        "says so.");
    m.def("read_times", &read_times, py::arg("table"), py::arg("stream"), Unlocked(),
          "Seconds of the frames of a stream from a file of `name timestamp` lines, or of as many "
          "times as frames, in their order.");
    m.def(
        "scalar_sources",
        [](StreamPointer images, const std::string& colormap) {
            std::string said;
            images = scalar_sources(std::move(images), colormap, said);
            return std::pair(images, said);
        },
        py::arg("images"), py::arg("colormap") = "auto", Unlocked(),
        R"(Source images with false colour turned back to numbers, and a line that says so, or ''.

colormap: auto (a few frames, spread over the footage, are read to decide), none (images as they
are), or the name of a known map.)");
    m.def(
        "oriented", py::overload_cast<StreamPointer>(&oriented), py::arg("stream"),
        "A stream of image files, each turned as its EXIF orientation asks for; another stream as "
        "it is.");
    m.def(
        "orientation_line", &orientation_line, py::arg("stream"), py::arg("applied"), Unlocked(),
        "A line where the first file of the stream asks for a turn, or ''. applied: whether it is "
        "turned.");
    m.def(
        "as_stored",
        [](const std::string& file) {
            std::string data = file;
            forget_tiff_orientation(data);
            return py::bytes(data);
        },
        py::arg("file"),
        "The bytes of an image file, of a TIFF as if it did not say how its picture is to be "
        "turned: "
        "OpenCV would do so, which it does with no other.");
}

}  // namespace xcalib

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "base/read_file.hpp"
#include "base/whole_file.hpp"
#include "bindings.hpp"
#include "from_python.hpp"
#include "xcalib/rig_file.hpp"
#include "xcalib/stream/arrays.hpp"
#include "xcalib/stream/files.hpp"
#include "xcalib/stream/outputs.hpp"
#include "xcalib/stream/tiff.hpp"
#include "xcalib/stream/video_length.hpp"
#include "xcalib/threads.hpp"

namespace xcalib {
namespace {

using Path = std::filesystem::path;
using Unlocked = py::call_guard<py::gil_scoped_release>;

}  // namespace

void bind_files(py::module_& m) {
    m.def(
        "max_threads", [] { return kMaxThreads; }, "How many threads may be asked for.");
    m.def(
        "implausible", &implausible, py::arg("rig"),
        R"(What of a rig is so unlikely that another unit or a slip may be behind it, a line each.)");
    m.def(
        "read_text",
        [](const Path& file) {
            const std::string data = read_file(file, kMaxTextBytes);
            check_text(data, file);
            return data;
        },
        py::arg("file"), Unlocked(),
        "A text that people write: InputError where it is no file, larger than 1 MiB, or not "
        "UTF-8.");
    m.def(
        "read_file",
        [](const Path& file) {
            const std::string data = unlocked([&] { return read_file(file, kMaxTableBytes); });
            return py::bytes(data);
        },
        py::arg("file"),
        "The bytes of a file: InputError where it is none, as a pipe, or larger than 1 GiB.");
    m.def(
        "read_array",
        [](const Path& file, bool is_image) -> py::object {
            const ArrayKind kind = is_image ? ArrayKind::image : ArrayKind::depth;
            const auto array = unlocked([&] { return read_array(file, kind); });
            if (!array) return py::none();
            return array_of(*array);
        },
        py::arg("file"), py::arg("is_image"),
        R"(What a .npy, .npz or .pfm file has, uint16 or float32; None where the suffix is another.

(h, w) or, of an image, which may be uint8, (h, w, 3). Raises DecodeError where it is damaged,
InputError where it is another array.)");
    m.def(
        "with_full_page_first",
        [](const std::string& data, const std::string& name) {
            std::string file = data;
            put_full_page_first(file, name);
            return py::bytes(file);
        },
        py::arg("data"), py::arg("name"),
        "The bytes of a TIFF file with the page of full size first, as of one that begins with a "
        "thumbnail; InputError, naming the file, where several pages are of that size.");
    m.def(
        "as_signed",
        [](const std::string& data) {
            std::string file = data;
            const bool is_unsigned = put_as_signed(file);
            return std::make_pair(is_unsigned, py::bytes(file));
        },
        py::arg("data"),
        "Whether a TIFF file has unsigned 32-bit pixels, and its bytes with these said to be "
        "signed, as OpenCV decodes them.");
    m.def("video_line", &video_line, py::arg("name"), py::arg("times"), py::arg("announced"),
          py::arg("rate"),
          "A line where fewer frames were decoded than the header announces, though they reach to "
          "the end; else ''. InputError where the file ends early.");
    m.def(
        "tiff_pixel_type",
        [](const py::bytes& data) { return tiff_pixel_type(static_cast<std::string_view>(data)); },
        py::arg("data"),
        "The type of a TIFF's pixels, as numpy calls it; '' where the data does not say.");
    m.def(
        "write_file",
        [](const Path& file, const py::bytes& data) {
            const auto view = static_cast<std::string_view>(data);
            const py::gil_scoped_release unlocked;
            write_file(file, view);
        },
        py::arg("file"), py::arg("data"),
        R"(Writes bytes: under the file's name only when they are complete and on the disk.

Its folder is made. What stands there is replaced; a link is followed; a pipe or a device is written
to as it is. Raises InputError where that cannot be.)");
    m.def(
        "keep_file",
        [](const Path& partial, const Path& file) {
            sync_to_disk(partial);
            std::filesystem::rename(partial, file);
            sync_to_disk(file.has_parent_path() ? file.parent_path() : Path("."));
        },
        py::arg("partial"), py::arg("file"), Unlocked(),
        "Gives a complete file, first made sure to be on the disk, its name.");
    m.def("list_files", &list_files, py::arg("folder"), py::arg("suffixes"), Unlocked(),
          "Files of a folder with one of the suffixes (any case), in natural order, at least one.");
    m.def("check_folder_writable", &check_folder_writable, py::arg("folder"), Unlocked(),
          "Raises InputError now, before long work, if nothing can be written below a folder, "
          "which need not exist, and is not made.");
    m.def("check_file_writable", &check_file_writable, py::arg("file"), Unlocked(),
          "Raises InputError now, before long work, if a file cannot be written.");
    m.def("check_output_writable", &check_output_writable, py::arg("output"), Unlocked(),
          "Raises InputError now if a folder or a video, as register writes, cannot be.");
    m.def(
        "check_writes",
        [](const std::vector<Path>& files, StreamPointer references, StreamPointer sources,
           py::object depth, const std::vector<Path>& other_reads) {
            const Frames frames{std::move(references), std::move(sources),
                                std::make_shared<PythonDepth>(std::move(depth))};
            const py::gil_scoped_release unlocked;
            check_writes(files, frames, other_reads);
        },
        py::arg("files"), py::arg("references"), py::arg("sources"), py::arg("depth"),
        py::arg("other_reads"),
        "Raises InputError if a run on these frames cannot write to all of the files, reads one of "
        "them, or would write one twice.");
}

}  // namespace xcalib

#include <pybind11/functional.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "bindings.hpp"
#include "from_python.hpp"
#include "xcalib/stream/interrupts.hpp"
#include "xcalib/stream/register_frames.hpp"

namespace xcalib {
namespace {

using Path = std::filesystem::path;

class PythonPart : public PartWriter {
   public:
    explicit PythonPart(Kept encoder) : encoder_(std::move(encoder)) {}
    ~PythonPart() override {
        try {
            in_python([&] { encoder_->attr("end")(); });
        } catch (const std::exception&) {
            // Something else has gone wrong before.
        }
    }
    void write(const Picture& image) override {
        in_python([&] { encoder_->attr("write")(array_of(image)); });
    }
    void close(int frames) override {
        in_python([&] { encoder_->attr("close")(frames); });
    }

   private:
    Kept encoder_;
};

class PythonCodecs : public Codecs {
   public:
    explicit PythonCodecs(py::object codecs) : codecs_(kept(std::move(codecs))) {}

    std::string encode_image(const Path& file, const Picture& image) override {
        return in_python([&] {
            return codecs_->attr("encode_image")(file, array_of(image)).cast<std::string>();
        });
    }
    std::string encoder_name() override {
        return in_python([&] { return codecs_->attr("encoder_name")().cast<std::string>(); });
    }
    std::unique_ptr<PartWriter> open_part(const Path& file, const Path& target,
                                          const Picture& first, double rate) override {
        return std::make_unique<PythonPart>(in_python(
            [&] { return kept(codecs_->attr("Encoder")(file, target, array_of(first), rate)); }));
    }
    void join(const std::vector<std::pair<Path, int>>& parts, const Path& file, const Path& target,
              double rate, const std::function<void()>& check) override {
        in_python(
            [&] { codecs_->attr("join")(parts, file, target, rate, py::cpp_function(check)); });
    }

   private:
    Kept codecs_;
};

void translate_interrupted(std::exception_ptr p) {
    try {
        if (p) std::rethrow_exception(p);
    } catch (const Interrupted& error) {
        PyErr_SetString(PyExc_KeyboardInterrupt, error.what());
    }
}

}  // namespace

void bind_register_frames(py::module_& m) {
    py::register_exception_translator(&translate_interrupted);
    m.def("is_video", &is_video_output, py::arg("output"),
          "Whether an output of this name is a video.");
    m.def("journal_of", &journal_of, py::arg("output"),
          "Where the journal of an output is: in the folder, or beside the video, named after it.");
    py::class_<Registration>(m, "Registration", "How far a stream is registered, and its totals.")
        .def_readonly("frames", &Registration::frames, "Of the stream.")
        .def_readonly("earlier", &Registration::earlier, "That were there from an earlier run.")
        .def_readonly("made", &Registration::made, "That this run has made.")
        .def_readonly("valid", &Registration::valid, "Valid pixels of the frames of either.")
        .def_readonly("pixels", &Registration::pixels, "Of all frames.")
        .def_readonly("not_finite", &Registration::not_finite,
                      "Source pixels of the frames of this run that are no number: masked.")
        .def_readonly("seconds", &Registration::seconds, "That this run took so far.")
        .def_property_readonly(
            "busy",
            [](const Registration& now) {
                py::dict shares;
                for (const auto& [name, share] : now.busy) shares[py::str(name)] = share;
                return shares;
            },
            "Share of that time, [0, 1], that each stage was at work, by name.")
        .def("line", &Registration::line, "While it is under way, in one line.")
        .def("summary", &Registration::summary, "At its end, in one line.");
    m.def(
        "register_frames",
        [](StreamPointer references, StreamPointer sources, py::object depth,
           const Registrar& registrar, const Path& output, bool overlays, bool overwrite,
           int part_frames, const MadeWith& inputs, const std::vector<Path>& other_reads,
           py::object codecs, const std::function<void(const Registration&)>& progress,
           bool hold_interrupts) {
            const Frames frames{std::move(references), std::move(sources),
                                std::make_shared<PythonDepth>(std::move(depth))};
            PythonCodecs compress(std::move(codecs));
            const py::gil_scoped_release unlocked;
            std::optional<Interrupts> held;
            if (hold_interrupts) held.emplace();
            return register_frames(frames, registrar.rig(), output,
                                   {registrar.options(), overlays, overwrite, part_frames},
                                   "xcalib", inputs, other_reads, compress,
                                   [&progress](const Registration& now) {
                                       const py::gil_scoped_acquire locked;
                                       if (PyErr_CheckSignals() != 0) throw py::error_already_set();
                                       progress(now);
                                   });
        },
        py::arg("references"), py::arg("sources"), py::arg("depth"), py::arg("registrar"),
        py::arg("output"), py::arg("overlays"), py::arg("overwrite"), py::arg("part_frames"),
        py::arg("inputs"), py::arg("other_reads"), py::arg("codecs"), py::arg("progress"),
        py::arg("hold_interrupts"),
        R"(Registers all frames that an earlier run has not written, and returns the Registration.

registrar: with a rig and options to register by; its threads are those of the whole run. part_frames:
of a video, that a run that is killed can lose at most. inputs: (name, text) of all that the frames
were opened with; an output of others is refused. other_reads: files that were read besides those of
the frames; nothing that is read is written to. codecs: has encode_image(file, image), which returns
bytes, encoder_name(), Encoder(file, target, first, rate) and join(parts, file, target, rate, check).
progress(registration) is called in this thread after frames, and a few times a second. hold_interrupts:
in the main thread, SIGINT and SIGTERM end the run between two frames, by KeyboardInterrupt.)");
}

}  // namespace xcalib

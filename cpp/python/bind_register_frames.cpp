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

std::vector<std::pair<std::string, std::string>> pairs_of(const std::vector<FrameName>& names) {
    std::vector<std::pair<std::string, std::string>> pairs;
    for (const FrameName& frame : names) pairs.emplace_back(frame.key, frame.name);
    return pairs;
}

// A begun registration whose frames are registered elsewhere.
class Ledger {
   public:
    Ledger(StreamPointer references, StreamPointer sources, py::object depth,
           const Registrar& registrar, const Path& output, bool overlays, bool overwrite,
           const MadeWith& inputs, const std::vector<Path>& other_reads, py::object codecs)
        : codecs_(std::move(codecs)) {
        const Frames frames{std::move(references), std::move(sources),
                            std::make_shared<PythonDepth>(std::move(depth))};
        const py::gil_scoped_release unlocked;
        begun_.emplace(frames, registrar.rig(), output,
                       RegistrationOptions{registrar.options(), overlays, overwrite}, "xcalib",
                       inputs, other_reads, codecs_);
        begun_->sink.reset();
    }
    const BegunRegistration& begun() const { return *begun_; }
    Journal& journal() const {
        if (!begun_->journal) throw std::invalid_argument("the ledger is closed");
        return *begun_->journal;
    }
    void close() { begun_->journal.reset(); }

   private:
    PythonCodecs codecs_;
    std::optional<BegunRegistration> begun_;
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
    m.def(
        "frame_names",
        [](StreamPointer references, StreamPointer sources, py::object depth) {
            const Frames frames{std::move(references), std::move(sources),
                                std::make_shared<PythonDepth>(std::move(depth))};
            const py::gil_scoped_release unlocked;
            return pairs_of(frame_names(frames));
        },
        py::arg("references"), py::arg("sources"), py::arg("depth"),
        "(key, name) of each frame; the key changes with the files that the frame is made of: "
        "their names, sizes and times.");
    m.def("frame_rate", &frame_rate, py::arg("references"),
          "Of a video of these frames [frames/s]: by the median of their times; 25 where they have "
          "none.");
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
    py::class_<Ledger>(m, "Ledger",
                       "A registration that has begun, whose frames are registered elsewhere.")
        .def(py::init<StreamPointer, StreamPointer, py::object, const Registrar&, const Path&, bool,
                      bool, const MadeWith&, const std::vector<Path>&, py::object>(),
             py::arg("references"), py::arg("sources"), py::arg("depth"), py::arg("registrar"),
             py::arg("output"), py::arg("overlays"), py::arg("overwrite"), py::arg("inputs"),
             py::arg("other_reads"), py::arg("codecs"),
             "As register_frames() begins, with the same refusals: the journal of the output is "
             "held until close().")
        .def_property_readonly(
            "names", [](const Ledger& ledger) { return pairs_of(ledger.begun().names); },
            "(key, name) of all frames, in order.")
        .def_property_readonly(
            "there", [](const Ledger& ledger) { return ledger.begun().there; },
            "Valid pixels of the frames that an earlier run has written, by their keys.")
        .def_property_readonly(
            "made_with", [](const Ledger& ledger) { return ledger.begun().made_with; },
            "(name, text) of all that the output depends on, but for the frames.")
        .def_property_readonly(
            "rig", [](const Ledger& ledger) { return ledger.begun().sized; },
            "The rig at the size of the images.")
        .def(
            "claim", [](const Ledger& ledger) { ledger.journal().claim(); },
            "Before the first file has its name: what is called as this output's files is of this "
            "run.")
        .def(
            "append",
            [](const Ledger& ledger,
               const std::vector<std::pair<std::vector<std::pair<std::string, long>>,
                                           std::vector<std::pair<std::string, std::uintmax_t>>>>&
                   units) {
                std::vector<Unit> whole;
                for (const auto& [frames, files] : units) whole.push_back({frames, files});
                const py::gil_scoped_release unlocked;
                ledger.journal().append(std::move(whole));
            },
            py::arg("units"),
            "Notes that files are whole, a unit (frames, files) for those that are whole only "
            "together: frames (key, valid pixels), in order, and files (name from the journal's "
            "folder, bytes).")
        .def("close", &Ledger::close, "Lets go of the journal.");
    m.def(
        "register_frames",
        [](StreamPointer references, StreamPointer sources, py::object depth,
           const Registrar& registrar, const Path& output, bool overlays, bool overwrite,
           int part_frames, const MadeWith& inputs, const std::vector<Path>& other_reads,
           py::object codecs, const std::function<void(const Registration&)>& progress,
           bool hold_interrupts, double rate) {
            const Frames frames{std::move(references), std::move(sources),
                                std::make_shared<PythonDepth>(std::move(depth))};
            PythonCodecs compress(std::move(codecs));
            const py::gil_scoped_release unlocked;
            std::optional<Interrupts> held;
            if (hold_interrupts) held.emplace();
            return register_frames(frames, registrar.rig(), output,
                                   {registrar.options(), overlays, overwrite, part_frames, rate},
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
        py::arg("hold_interrupts"), py::arg("rate") = 0.0,
        R"(Registers all frames that an earlier run has not written, and returns the Registration.

registrar: with a rig and options to register by; its threads are those of the whole run. part_frames:
of a video, that a run that is killed can lose at most. inputs: (name, text) of all that the frames
were opened with; an output of others is refused. other_reads: files that were read besides those of
the frames; nothing that is read is written to. codecs: has encode_image(file, image), which returns
bytes, encoder_name(), Encoder(file, target, first, rate) and join(parts, file, target, rate, check).
progress(registration) is called in this thread after frames, and a few times a second. hold_interrupts:
in the main thread, SIGINT and SIGTERM end the run between two frames, by KeyboardInterrupt. rate: of a video [frames/s];
0: that of the references.)");
}

}  // namespace xcalib

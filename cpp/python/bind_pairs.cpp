#include <pybind11/functional.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "bindings.hpp"
#include "from_python.hpp"
#include "xcalib/stream/pairs.hpp"

namespace xcalib {

using Unlocked = py::call_guard<py::gil_scoped_release>;

void bind_pairs(py::module_& m) {
    m.def(
        "pair_streams",
        [](const Stream& references, const Stream& sources, const std::string& method,
           double offset, std::optional<double> max_gap) {
            return pair_frames(references.frames(), sources.frames(), method, offset, max_gap);
        },
        py::arg("references"), py::arg("sources"), py::arg("method") = "auto",
        py::arg("offset") = 0.0, py::arg("max_gap") = py::none(), Unlocked(),
        R"(Pairs two streams.

method: name (pair_files), order (first with first, of equally many), time (pair_times), or auto: by
time where both have times, else files by name, and others in order. offset [s]: reference time t is
source time t + offset; not 0: by time. Raises InputError.)");
    m.def(
        "match_depths",
        [](const Stream& references, const std::vector<int>& used, const Stream& depths) {
            return match_depths(references.frames(), used, depths.frames());
        },
        py::arg("references"), py::arg("used"), py::arg("depths"), Unlocked(),
        R"(The depth file, as an index into depths, of each of the references used.

Files under the names of the frames are theirs, and others are left over. Else the nearest in time
within half a period of the references, where both tell it; else by pair_files, of all references or
of those in use. Raises InputError.)");
    m.def(
        "nearest_depths",
        [](const Stream& references, const std::vector<int>& used, const Stream& depths) {
            return nearest_depths(references.frames(), used, depths.times.value(), depths.where(0));
        },
        py::arg("references"), py::arg("used"), py::arg("depths"), Unlocked(),
        "The nearest depth map in time, as match_depths() does it, of streams with times.");
    m.def("estimate_offset", py::overload_cast<Stream&, Stream&, double, int>(&estimate_offset),
          py::arg("references"), py::arg("sources"), py::arg("max_offset") = 2.0,
          py::arg("max_frames") = 1500, Unlocked(),
          R"(A constant offset between the clocks of two streams with times, neither registered.

max_offset: the largest looked for, either way [s]; also at most a third of the footage. max_frames:
references read at most, from the middle of the footage. Raises InputError where the times do not
overlap.)");
    m.def("offsets_around",
          py::overload_cast<double, const Stream&, const Stream&>(&offsets_around),
          py::arg("guess"), py::arg("references"), py::arg("sources"),
          "Candidates for refine_offset(): 6 frames of the faster stream either way, in quarters "
          "[s].");
    m.def(
        "refine_offset",
        [](const Rig& rig, Stream& references, Stream& sources, py::object depth,
           const std::vector<double>& candidates, int max_frames) {
            PythonDepth provider(std::move(depth));
            const py::gil_scoped_release unlocked;
            return refine_offset(rig, references, sources, provider, candidates, max_frames);
        },
        py::arg("rig"), py::arg("references"), py::arg("sources"), py::arg("depth"),
        py::arg("candidates"), py::arg("max_frames") = 12,
        R"(Chooses among candidate offsets by how well the frames register with a rig.

candidates [s], rising, around a guess in their middle. Of those that differ from the best by less
than the frames do among each other (two standard errors of the mean), the one nearest to the middle
is taken: the guess, unless the frames speak against it. Candidates that pair the same frames score
the same. max_frames: frames of the slower stream judged, spread over the footage, the same ones for
every candidate; those that cannot be decoded are left out. Raises InputError without candidates or
times.)");
    py::class_<Pairs>(m, "Pairs", "Two streams, and which of their frames belong together.")
        .def(py::init([](StreamPointer references, StreamPointer sources, std::string method,
                         std::optional<double> time_offset, std::optional<double> max_gap,
                         const std::optional<std::filesystem::path>& reference_times,
                         const std::optional<std::filesystem::path>& source_times,
                         std::optional<OffsetEstimate> estimate, int frame_offset) {
                 return Pairs(std::move(references), std::move(sources),
                              {std::move(method),
                               {!time_offset, time_offset.value_or(0.0), frame_offset},
                               max_gap,
                               reference_times.value_or(""),
                               source_times.value_or("")},
                              std::move(estimate));
             }),
             py::arg("references"), py::arg("sources"), py::arg("method") = "auto",
             py::arg("time_offset") = 0.0, py::arg("max_gap") = py::none(),
             py::arg("reference_times") = py::none(), py::arg("source_times") = py::none(),
             py::arg("estimate") = py::none(), py::arg("frame_offset") = 0, Unlocked(),
             "As pair_streams(); time_offset None: estimated; frame_offset: by how many of its "
             "frames "
             "the source is late beyond that. The tables are read by read_times(). "
             "Nothing else is read, save that an offset to be estimated, unless there is an "
             "estimate, needs the frames.")
        .def(
            "refine",
            [](Pairs& pairs, const Rig& rig,
               const std::function<py::object(std::vector<int>)>& open) {
                const py::gil_scoped_release unlocked;
                pairs.refine(rig, [&open](const std::vector<int>& used) -> DepthPointer {
                    return in_python([&] { return std::make_shared<PythonDepth>(open(used)); });
                });
            },
            py::arg("rig"), py::arg("open_depth"),
            "Pairs anew with the offset at which frames register best with the rig. "
            "open_depth(used): the provider of the depth of these of all references. Without an "
            "estimated offset "
            "the pairs stay as they are, and so they do where the registered frames tell neither "
            "around the estimate nor around 0. Sequences without times are looked at up to 6 "
            "frames "
            "either way.")
        .def_property_readonly("references", &Pairs::references, "Those that have a partner.")
        .def_property_readonly("sources", &Pairs::sources, "Their partners, in the same order.")
        .def_property_readonly("all_references", &Pairs::all_references, "With those that do not.")
        .def_property_readonly("all_sources", &Pairs::all_sources, "With those that do not.")
        .def_property_readonly("offset", &Pairs::offset, "TimeOffset that they are paired with.")
        .def_property_readonly("pairing", &Pairs::pairing, "Indices into the streams.")
        .def_property_readonly("notes", &Pairs::notes, "What the user should know, a line each.");
}

}  // namespace xcalib

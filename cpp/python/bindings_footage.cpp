// Footage: its order and pairs, which frames a calibration uses, false colour, depth by rule.
#include <pybind11/functional.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "xcalib/depth/complete_depth.hpp"
#include "xcalib/depth/fit_plane.hpp"
#include "xcalib/depth/steady_depth.hpp"
#include "xcalib/footage/choose.hpp"
#include "xcalib/footage/clock_offset.hpp"
#include "xcalib/footage/false_colour.hpp"
#include "xcalib/footage/fingerprint.hpp"
#include "xcalib/footage/pairing.hpp"

namespace xcalib {
namespace {

py::array_t<float> array_of(const Image& image) {
    return py::array_t<float>({image.height, image.width}, image.pixels.data());
}

py::array_t<std::ptrdiff_t> indices_of(const std::vector<int>& indices) {
    py::array_t<std::ptrdiff_t> out(static_cast<py::ssize_t>(indices.size()));
    std::copy(indices.begin(), indices.end(), out.mutable_data());
    return out;
}

void bind_pairing(py::module_& m) {
    m.def("natural_order", &natural_order, py::arg("names"),
          "Indices of names in the order in which people count: runs of digits compare as numbers, "
          "letters of ASCII without their case.");
    m.def("pair_files", &pair_files, py::arg("first"), py::arg("second"),
          R"(The partner in second of each file of first, as indices; neither may be empty.

Files of the same stem belong together; if none is common, those with the same numbers in their
names; if none is common either, their order decides. Raises InputError, naming what has no partner,
where names agree only in part or the counts differ.)");
    m.def("times_of_names", &times_of_names, py::arg("names"),
          "Seconds where every name holds one time since 1970 (19, 16 or 13 digits, or seconds "
          "with a fraction) and they rise; None otherwise.");
    m.def("times_of_table", &times_of_table, py::arg("text"), py::arg("table"), py::arg("names"),
          R"(Seconds of each name, from the text of a table of `name timestamp` lines.

Names with or without suffix, then a comma, semicolon or blanks; lines of other kinds may only come
first, # comments anywhere. Times of 19, 16 or 13 digits are nano-, micro- and milliseconds, others
seconds. Raises InputError that begins with table, the file's name.)");
    m.def("median_period", &median_period, py::arg("times"),
          "Median distance of times [s]; 0 for a single one.");

    py::class_<FrameList>(m, "FrameList", "The frames of a camera, without their pixels.")
        .def(py::init([](std::vector<std::string> names, std::vector<std::string> where,
                         std::vector<std::filesystem::path> paths,
                         std::optional<std::vector<double>> times) {
                 return FrameList{std::move(names), std::move(paths), std::move(times),
                                  std::move(where)};
             }),
             py::arg("names"), py::arg("where"),
             py::arg("paths") = std::vector<std::filesystem::path>{}, py::arg("times") = py::none(),
             "names: without suffix; where: for messages; paths: of image files, none for other "
             "frames; times: seconds, never falling, or None.");

    py::class_<Pairing>(m, "Pairing", "Indices into two streams, and how they were found.")
        .def(
            py::init([](std::string method, std::vector<int> references, std::vector<int> sources) {
                Pairing pairing;
                pairing.method = std::move(method);
                pairing.references = std::move(references);
                pairing.sources = std::move(sources);
                return pairing;
            }),
            py::arg("method"), py::arg("references"), py::arg("sources"))
        .def_readonly("method", &Pairing::method, "name, order or time.")
        .def_property_readonly(
            "references", [](const Pairing& p) { return indices_of(p.references); },
            "(N,) indices.")
        .def_property_readonly(
            "sources", [](const Pairing& p) { return indices_of(p.sources); }, "(N,) indices.")
        .def_property_readonly(
            "dropped",
            [](const Pairing& p) { return std::pair(p.dropped_references, p.dropped_sources); },
            "Frames of either stream without a partner.")
        .def_readonly("gap", &Pairing::gap, "Median distance in time, the offset allowed for [s].")
        .def_readonly("offset", &Pairing::offset, "By how much the source's clock is late [s].")
        .def("line", &Pairing::line, "What happened, in one line.");

    m.def("pair_times", &pair_times, py::arg("references"), py::arg("sources"),
          py::arg("offset") = 0.0, py::arg("max_gap") = py::none(),
          R"(Pairs nearest times, one to one and in order, at most max_gap apart [s].

The frames of the stream with fewer of them choose, one after the other, among the frames behind the
last one chosen. By default max_gap is half the larger median period. Raises InputError where no two
are near.)");
    m.def("pair_frames", &pair_frames, py::arg("references"), py::arg("sources"),
          py::arg("method") = "auto", py::arg("offset") = 0.0, py::arg("max_gap") = py::none(),
          R"(Pairs two FrameLists.

method: name (pair_files), order (first with first, of equally many), time (pair_times), or auto: by
time where both have times, else files by name, and others in order. offset [s]: reference time t is
source time t + offset; not 0: by time. Raises InputError.)");
    m.def("match_depths", &match_depths, py::arg("references"), py::arg("used"), py::arg("depths"),
          R"(The depth map, as an index into depths, of each of the references used.

Files under the names of the frames are theirs, and others are left over. Else the nearest in time
within half a period of the references, where both tell it; else by pair_files, of all references or
of those in use. Raises InputError.)");
    m.def("nearest_depths", &nearest_depths, py::arg("references"), py::arg("used"),
          py::arg("depths"), py::arg("where"),
          "The nearest depth map in time, as match_depths() does it; depths: their times [s].");
}

void bind_clock_offset(py::module_& m) {
    py::class_<OffsetEstimate>(m, "OffsetEstimate", "A clock offset, and what speaks for it.")
        .def(py::init(
                 [](double offset, bool trusted, double correlation, double contrast, double peak) {
                     return OffsetEstimate{offset, trusted, correlation, contrast, peak};
                 }),
             py::arg("offset"), py::arg("trusted"), py::arg("correlation"), py::arg("contrast"),
             py::arg("peak"))
        .def_readonly("offset", &OffsetEstimate::offset,
                      "By how much the source's clock is late [s]; 0 where the footage does not "
                      "tell.")
        .def_readonly("trusted", &OffsetEstimate::trusted, "Whether it does.")
        .def_readonly("correlation", &OffsetEstimate::correlation,
                      "Height of the peak, in [-1, 1].")
        .def_readonly("contrast", &OffsetEstimate::contrast,
                      "What it stands above the best peak elsewhere.")
        .def_readonly("peak", &OffsetEstimate::peak, "Where the peak is [s], trusted or not.")
        .def("line", &OffsetEstimate::line, "In one line.");
    m.def(
        "motion_edges",
        [](const py::object& image) {
            const Held held = image_of("image", image);
            Image edges;
            {
                const py::gil_scoped_release unlocked;
                edges = motion_edges(held.view);
            }
            return array_of(edges);
        },
        py::arg("image"),
        "Magnitude of the gradient of a small gray copy, (h, 160) float32: about 1 on an edge "
        "whatever the gain. Pixels that are not finite count as black.");
    using EdgesInPython = std::function<py::object(int)>;
    m.def(
        "estimate_offset",
        [](const std::vector<double>& references, const std::vector<double>& sources,
           const EdgesInPython& reference_edges, const EdgesInPython& source_edges,
           double max_offset, int max_frames) {
            const auto edges_of = [](const EdgesInPython& given) {
                return [&given](int index) -> std::optional<Image> {
                    const py::object edges = given(index);
                    if (edges.is_none()) return std::nullopt;
                    const Held held = depth_of("edges", edges);
                    Image out(held.view.width, held.view.height);
                    const float* first = held.view.row<float>(0);
                    std::copy(first, first + out.pixels.size(), out.pixels.begin());
                    return out;
                };
            };
            return estimate_offset(references, sources, edges_of(reference_edges),
                                   edges_of(source_edges), max_offset, max_frames);
        },
        py::arg("references"), py::arg("sources"), py::arg("reference_edges"),
        py::arg("source_edges"), py::arg("max_offset") = 2.0, py::arg("max_frames") = 1500,
        R"(A constant offset between the clocks of two streams, neither registered.

references, sources: times of their frames [s], never falling, each on its own clock.
reference_edges, source_edges: motion_edges() of frame i, None where it cannot be decoded.
max_offset: the largest looked for, either way [s]; also at most a third of the footage. max_frames:
references asked for at most, from the middle of the footage. Raises InputError where the times do
not overlap.)");

    py::class_<RefinedOffset>(
        m, "RefinedOffset",
        "A clock offset chosen by how well frames register, and what speaks for it.")
        .def_readonly("offset", &RefinedOffset::offset,
                      "By how much the source's clock is late [s]; the middle candidate where "
                      "nothing is told.")
        .def_readonly("told", &RefinedOffset::told,
                      "Whether the frames register worse at both ends of the candidates.")
        .def_readonly("scores", &RefinedOffset::scores,
                      "Mean NEC of the frames judged, at each candidate; empty if fewer than two "
                      "can be.")
        .def("line", &RefinedOffset::line, "In one line.");
    m.def("offsets_around", &offsets_around, py::arg("guess"), py::arg("references"),
          py::arg("sources"),
          "Candidates for refine_offset(), from the times of both streams [s]: 6 frames of the "
          "faster one either way, in quarters [s].");
    py::class_<RegisteredNec>(m, "RegisteredNec",
                              "NEC of a reference and a source frame, registered.")
        .def(py::init<const Rig&>(), py::arg("rig"), "Rescaled to the frames.")
        .def(
            "__call__",
            [](RegisteredNec& judge, const py::object& reference, const py::object& source,
               const py::object& depth) {
                const Held r = image_of("reference", reference), s = image_of("source", source);
                const Held d = depth_of("depth", depth);
                const py::gil_scoped_release unlocked;
                return judge(r.view, s.view, d.view);
            },
            py::arg("reference"), py::arg("source"), py::arg("depth"),
            "In [0, 1]; 0 where no pixel is valid. Frames of one size; depth (h, w) float32 [m], 0 "
            "unknown.");
    m.def("refine_offset", &refine_offset, py::arg("references"), py::arg("sources"),
          py::arg("candidates"), py::arg("score"), py::arg("max_frames") = 12,
          R"(Chooses among candidate offsets [s], rising, around a guess in their middle.

references, sources: times of their frames [s]. score: the RegisteredNec of a reference and a source
frame, by their indices, None where one cannot be decoded. Of the candidates that differ from the
best by less than the frames do among each other (two standard errors of the mean), the one nearest
to the middle is taken. max_frames: of the slower stream, spread over the footage. Raises InputError
without candidates.)");
}

void bind_fingerprint(py::module_& m) {
    m.def(
        "fingerprint", [](const std::string& data) { return fingerprint(data); }, py::arg("data"),
        "16 hexadecimal digits of a text, or of bytes: it tells changes by accident, not by "
        "intent.");
    m.def(
        "rig_fingerprint", [](const Rig& rig) { return fingerprint(rig); }, py::arg("rig"),
        "The fingerprint() of all numbers of a rig.");
    m.def("absolute_path", &absolute_path, py::arg("path"),
          "A path from the root, without `.` and empty parts; `..` and links stay.");
    m.def("file_stamp", &file_stamp, py::arg("path"),
          "Where a file is, its size, and the time of its last change; of a folder, those of all "
          "files in it. A path that cannot be read is itself.");
}

void bind_choice(py::module_& m) {
    m.def("frames_to_look_at", &frames_to_look_at, py::arg("count"), py::arg("max_frames"),
          py::arg("seed"),
          "Indices of the frames, of count, that a choice of max_frames looks at: four of each "
          "wanted, drawn with seed; rising.");
    py::class_<Candidate>(m, "Candidate", "What is kept of one frame, and what became of it.")
        .def(py::init([](int index, std::string reason) {
                 Candidate candidate;
                 candidate.index = index;
                 candidate.decoded = false;
                 candidate.reason = std::move(reason);
                 return candidate;
             }),
             py::arg("index"), py::arg("reason"), "A frame that cannot be decoded.")
        .def_readonly("index", &Candidate::index, "Of the frame in the footage.")
        .def_readonly("decoded", &Candidate::decoded, "Whether there were images to look at.")
        .def_readonly("taken", &Candidate::taken, "Whether it is in the choice.")
        .def_readonly("reason", &Candidate::reason, "Why it was taken or left.")
        .def_readonly("agreement", &Candidate::agreement,
                      "Normalized correlation of the two images' edges where the footage as a "
                      "whole aligns; NaN where not measured.")
        .def_readonly("gain", &Candidate::gain,
                      "What it added, or at the end would have added, to the log-determinant of "
                      "the information; NaN where not measured.");
    m.def(
        "look_at",
        [](int index, const py::object& reference, const py::object& source,
           const py::object& depth) {
            const Held r = image_of("reference", reference), s = image_of("source", source);
            std::optional<Held> d;
            if (!depth.is_none()) d = depth_of("depth", depth);
            const py::gil_scoped_release unlocked;
            return look_at(index, r.view, s.view, d ? &d->view : nullptr);
        },
        py::arg("index"), py::arg("reference"), py::arg("source"), py::arg("depth") = py::none(),
        "The Candidate of a frame; depth (h, w) float32 [m], None leaves it out of the choice.");
    py::class_<Choice>(m, "Choice",
                       "The frames to calibrate on, and what was found out on the way.")
        .def_readonly("indices", &Choice::indices, "Of the frames taken, rising.")
        .def_readonly("candidates", &Choice::candidates, "Every frame looked at, in order.")
        .def_property_readonly("unusable", &Choice::unusable,
                               "Candidates that something was found against: they never were in "
                               "the choice.")
        .def("table", &Choice::table, py::arg("names"),
             "One line per candidate: its name, what was measured, why it was taken or left.");
    m.def("choose", &choose, py::arg("candidates"), py::arg("max_frames"),
          py::call_guard<py::gil_scoped_release>(),
          "The Choice of at most max_frames of the candidates that say most about the rig; without "
          "a usable one it is empty.");
}

void bind_false_colour(py::module_& m) {
    py::class_<ColorMap>(m, "ColorMap", "A curve in the colour cube, from cold to hot.")
        .def_readonly("name", &ColorMap::name, "Of a known map, or `estimated`.")
        .def_property_readonly(
            "curve",
            [](const ColorMap& map) {
                return py::array_t<std::uint8_t>({256, 3}, map.curve.front().data());
            },
            "(256, 3) uint8, blue, green, red.")
        .def(
            "invert",
            [](const ColorMap& map, const py::object& image) -> py::object {
                const Held held = image_of("image", image);
                if (held.view.channels != 3) return held.array;
                std::vector<std::uint8_t> places;
                {
                    const py::gil_scoped_release unlocked;
                    places = map.invert(held.view);
                }
                return py::array_t<std::uint8_t>({held.view.height, held.view.width},
                                                 places.data());
            },
            py::arg("image"),
            "The place of each pixel on the curve, 0 to 255: (h, w, 3) to (h, w) uint8. An image "
            "of one channel is returned as it is.");
    m.def("known_color_maps", &known_color_maps, "OpenCV's, and `iron`.");
    m.def("known_color_map", &known_color_map, py::arg("name"),
          "Raises InputError that lists the names.");
    m.def("frames_to_recognise_by", &frames_to_recognise_by, py::arg("count"),
          "A few of count frames, spread over the footage, rising.");
    m.def(
        "recognise",
        [](const py::sequence& images) {
            const HeldList held = list_of("image", images, image_of);
            const py::gil_scoped_release unlocked;
            return recognise(held.views);
        },
        py::arg("images"),
        R"(The ColorMap of false-colour images of one camera, or None if they are none.

The known map that is nearest, or one named `estimated`, whose bright end counts as hot. Gray
images, tinted ones, and photographs give None. A few images are enough, and more than one is better
where the map is not a known one.)");
}

void bind_depth(py::module_& m) {
    py::class_<PlaneDepth>(m, "PlaneDepth",
                           R"(Road-plane prior: a flat road under the camera, all else far away.

D(x, y) = camera_height * fy / r(x, y), where r is the distance of a pixel below the horizon [px],
never beyond far, which is also the depth at and above the horizon.)")
        .def(py::init([](double camera_height, double horizon, double far, double hfov_deg,
                         double roll_deg) {
                 const PlaneDepth plane{camera_height, horizon, far, hfov_deg, roll_deg};
                 plane.validate();
                 return plane;
             }),
             py::arg("camera_height") = PlaneDepth{}.camera_height,
             py::arg("horizon") = PlaneDepth{}.horizon, py::arg("far") = PlaneDepth{}.far,
             py::arg("hfov_deg") = PlaneDepth{}.hfov_deg,
             py::arg("roll_deg") = PlaneDepth{}.roll_deg, "Raises InputError: field, value, range.")
        .def_readonly("camera_height", &PlaneDepth::camera_height,
                      "Of the reference camera above the road [m], > 0.")
        .def_readonly("horizon", &PlaneDepth::horizon,
                      "Its row in the middle column, as a fraction of the image height from the "
                      "top, (-1, 1).")
        .def_readonly("far", &PlaneDepth::far, "Largest depth [m], > 0.")
        .def_readonly("hfov_deg", &PlaneDepth::hfov_deg,
                      "Of the reference camera [deg], (0, 180); pixels are square.")
        .def_readonly("roll_deg", &PlaneDepth::roll_deg,
                      "How far the horizon falls towards the right [deg], (-45, 45).")
        .def_property_readonly(
            "parallel", [](const PlaneDepth&) { return true; },
            "Several threads may ask for depth at a time.")
        .def(
            "__call__",
            [](const PlaneDepth& plane, int, const py::array& reference) {
                return array_of(plane(static_cast<int>(reference.shape(1)),
                                      static_cast<int>(reference.shape(0))));
            },
            py::arg("index"), py::arg("reference"),
            "Depth of any frame: (H, W) float32 [m], of the reference image's size.");
    m.def("frames_to_judge_plane", &frames_to_judge_plane, py::arg("count"),
          "Of count frames, those that judge a plane: at most a dozen, evenly spread.");
    m.def(
        "fit_plane",
        [](const py::sequence& references, const py::sequence& sources, const PlaneDepth& plane,
           const Rig& rig, const CalibrationOptions& options, const py::object& progress) {
            const HeldList r = list_of("reference", references, image_of);
            const HeldList s = list_of("source", sources, image_of);
            const auto tell = [&progress] {
                const py::gil_scoped_acquire gil;
                if (PyErr_CheckSignals() != 0) throw py::error_already_set();  // Ctrl-C
                if (!progress.is_none()) progress();
            };
            const py::gil_scoped_release unlocked;
            return fit_plane(r.views, s.views, plane, rig, options, tell);
        },
        py::arg("references"), py::arg("sources"), py::arg("plane"), py::arg("rig"),
        py::arg("options"), py::arg("progress") = py::none(),
        R"(The PlaneDepth near plane whose best rig aligns most edges.

references, sources: images as calibrate() takes them; a dozen is enough. plane: where to start; its
height, far distance and field of view are kept, since height scales depth and translation alike.
rig: fitted with plane, where fits start. options: known cameras and threads are kept. progress: is
called after each fit.)");

    m.def(
        "completion_confidence", [] { return kCompletionConfidence; },
        "Filled pixels below it stay unknown, unless asked for.");
    m.def(
        "complete_depth",
        [](const py::object& depth, const py::object& guide) {
            const Held d = depth_of("depth", depth), g = image_of("guide", guide);
            CompletedDepth out;
            {
                const py::gil_scoped_release unlocked;
                out = complete_depth(d.view, g.view);
            }
            return py::make_tuple(array_of(out.depth), array_of(out.confidence));
        },
        py::arg("depth"), py::arg("guide"),
        R"(Fills the unknown pixels of a depth map along image edges; known ones are kept.

depth (h, w) float32 [m], 0 unknown; guide: the reference image, of the same aspect. Returns
(depth, confidence), (h, w) float32 each: depth > 0 everywhere; confidence in [0, 1], 1 where depth
was known, and lower the farther a pixel is from known depth and the more depth varies around it. An
order, not a probability. Raises InputError where nothing is known or the aspects differ.)");
    m.def(
        "completed",
        [](const py::object& depth, const py::object& guide, double min_confidence) {
            const Held d = depth_of("depth", depth), g = image_of("guide", guide);
            Image out;
            {
                const py::gil_scoped_release unlocked;
                out = completed(d.view, g.view, min_confidence);
            }
            return array_of(out);
        },
        py::arg("depth"), py::arg("guide"), py::arg("min_confidence") = kCompletionConfidence,
        "The depth of complete_depth() where its confidence is at least min_confidence, [0, 1]; 0 "
        "elsewhere.");
    m.def(
        "compressed_guide",
        [](const py::object& guide, int width, int height) {
            const Held g = image_of("guide", guide);
            return array_of(compressed_guide(g.view, width, height));
        },
        py::arg("guide"), py::arg("width"), py::arg("height"),
        "The guide as gray of another size, with the contrast of dark parts raised: (height, "
        "width) float32 in [0, 1].");

    py::class_<DepthSteadier>(m, "DepthSteadier",
                              R"(Depth of a video, averaged over time along the image flow; causal.

What the last frame knew is carried to this one by patch_flow() between their reference images, and
by one forward speed for the whole frame. A pixel goes on with the running mean of its inverse depth,
of 4 frames at most, or starts anew where depth or image around it has changed.)")
        .def(py::init<>())
        .def(
            "__call__",
            [](DepthSteadier& steadier, int index, const py::object& depth,
               const py::object& reference, int num_threads) {
                const Held d = depth_of("depth", depth), r = image_of("reference", reference);
                Image out;
                {
                    const py::gil_scoped_release unlocked;
                    out = steadier(index, d.view, r.view, num_threads);
                }
                return array_of(out);
            },
            py::arg("index"), py::arg("depth"), py::arg("reference"), py::arg("num_threads") = 0,
            "Frames are to follow on each other; any other one starts anew, and passes as it is. "
            "depth (h, w) float32 [m], 0 unknown, which stays unknown; reference: its image, of "
            "the same aspect. The result does not depend on num_threads.");
}

}  // namespace

void bind_footage(py::module_& m) {
    bind_pairing(m);
    bind_clock_offset(m);
    bind_fingerprint(m);
    bind_choice(m);
    bind_false_colour(m);
    bind_depth(m);
}

}  // namespace xcalib

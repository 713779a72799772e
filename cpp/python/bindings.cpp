// The Python module: it converts and calls, nothing else.
#include "bindings.hpp"

#include <pybind11/eigen.h>
#include <pybind11/functional.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <Eigen/LU>
#include <cmath>
#include <system_error>

#include "arrays.hpp"
#include "xcalib/calibrate.hpp"
#include "xcalib/draw_frames.hpp"
#include "xcalib/error.hpp"
#include "xcalib/flow.hpp"
#include "xcalib/gray.hpp"
#include "xcalib/judge/metrics.hpp"
#include "xcalib/nec.hpp"
#include "xcalib/register.hpp"
#include "xcalib/rig_file.hpp"

namespace py = pybind11;
using namespace xcalib;

namespace {

constexpr double kDegree = 3.14159265358979323846 / 180;

// The caller's array to write to, which shares nothing with `others`, or a new one.
py::array result_of(const char* name, const py::object& object, const py::dtype& dtype,
                    const std::vector<py::ssize_t>& shape,
                    std::initializer_list<std::pair<const char*, const py::array&>> others) {
    if (object.is_none()) return py::array(dtype, shape);
    if (!py::isinstance<py::array>(object))
        throw py::value_error(std::string(name) + " is not a numpy array");
    const auto given = py::reinterpret_borrow<py::array>(object);
    const bool fits =
        std::equal(shape.begin(), shape.end(), given.shape(), given.shape() + given.ndim()) &&
        given.dtype().equal(dtype);
    constexpr int kFlags = py::array::c_style | kAligned;
    if (!fits || !given.writeable() || (given.flags() & kFlags) != kFlags)
        throw py::value_error(std::string(name) + " has " + shape_text(given) + ", expected " +
                              shape_text(py::array(dtype, shape)) +
                              ", contiguous, aligned and writeable");
    const auto begin = [](const py::array& a) { return static_cast<const char*>(a.data()); };
    for (const auto& [other, array] : others)
        if (begin(given) < begin(array) + array.nbytes() &&
            begin(array) < begin(given) + given.nbytes())
            throw py::value_error(std::string(name) + " overlaps " + other +
                                  ", expected memory of its own");
    return given;
}

Image gray_of(const char* name, const py::object& object) {
    return to_gray(image_of(name, object).view);
}

// Two images of one size as gray, and the mask over them.
struct Compared {
    Image reference, registered;
    py::array_t<std::uint8_t, py::array::c_style | py::array::forcecast> mask;
    const std::uint8_t* valid = nullptr;
};

Compared compared(const py::object& reference, const py::object& registered,
                  const py::object& mask) {
    Compared out;
    out.reference = gray_of("reference", reference);
    out.registered = gray_of("registered", registered);
    const auto size = [](const Image& image) {
        return std::to_string(image.width) + "x" + std::to_string(image.height);
    };
    if (out.reference.width != out.registered.width ||
        out.reference.height != out.registered.height)
        throw py::value_error("registered is " + size(out.registered) +
                              ", expected the reference's " + size(out.reference));
    if (!mask.is_none()) {
        const py::array given = py::array::ensure(mask);
        if (!given || given.ndim() != 2 || given.shape(0) != out.reference.height ||
            given.shape(1) != out.reference.width)
            throw py::value_error("mask has " + (given ? shape_text(given) : "no shape") +
                                  ", expected the images' " + size(out.reference));
        out.mask = py::module_::import("numpy").attr("not_equal")(given, 0);
        out.valid = out.mask.data();
    }
    return out;
}

template <class Value>
py::array_t<Value> array_of(const std::vector<Value>& values, int width, int height) {
    return py::array_t<Value>({height, width}, values.data());
}

// What a flow provider returned, as a field with a vector at every pixel.
FlowField field_from(const py::object& returned, int width, int height) {
    const char* expected =
        "flow provider: expected (flow, confidence), arrays (H, W, 2) and (H, W) of the images' ";
    const auto refuse = [&](const std::string& got) {
        throw py::value_error(expected + std::to_string(width) + "x" + std::to_string(height) +
                              ", got " + got);
    };
    if (!py::isinstance<py::sequence>(returned) || py::len(returned) != 2)
        refuse(py::type::of(returned).attr("__name__").cast<std::string>());
    using Floats = py::array_t<float, py::array::c_style | py::array::forcecast>;
    const py::sequence pair = returned;
    const Floats flow = Floats::ensure(pair[0]), confidence = Floats::ensure(pair[1]);
    if (!flow || flow.ndim() != 3 || flow.shape(0) != height || flow.shape(1) != width ||
        flow.shape(2) != 2)
        refuse(flow ? "flow of " + shape_text(flow) : "no array of flow");
    if (!confidence || confidence.ndim() != 2 || confidence.shape(0) != height ||
        confidence.shape(1) != width)
        refuse(confidence ? "confidence of " + shape_text(confidence) : "no array of confidence");
    const std::size_t count = static_cast<std::size_t>(width) * height;
    FlowField field{width,
                    height,
                    1,
                    std::vector<float>(count),
                    std::vector<float>(count),
                    std::vector<float>(confidence.data(), confidence.data() + count)};
    for (std::size_t i = 0; i < count; ++i) {
        field.x[i] = flow.data()[2 * i];
        field.y[i] = flow.data()[2 * i + 1];
    }
    return field;
}

// Gray images of integers lie in [0, 1], and float32 images are taken to.
double range_of(const py::object& data_range) {
    if (data_range.is_none()) return 1.0;
    const double value = data_range.cast<double>();
    if (!(value > 0))
        throw py::value_error("data_range is " + std::to_string(value) + ", expected > 0");
    return value;
}

template <class Matrix>
Matrix numbers_of(const char* name, const py::object& object, const char* expected) {
    try {
        return object.cast<Matrix>();
    } catch (const py::cast_error&) {
        throw py::value_error(std::string(name) + " is " + std::string(py::repr(object)) +
                              ", expected " + expected);
    }
}

Rig make_rig(const Pinhole& reference, const Pinhole& source, const py::object& R,
             const py::object& t) {
    Rig rig;
    rig.reference = reference;
    rig.source = source;
    if (!R.is_none()) {
        const auto matrix = numbers_of<Eigen::Matrix3d>("R", R, "a (3, 3) array of numbers");
        if (!((matrix * matrix.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-6 &&
              matrix.determinant() > 0))
            throw py::value_error("R is not a rotation matrix (R R^T = I, det R = 1 within 1e-6)");
        rig.source_from_reference.rotation = Eigen::Quaterniond(matrix).normalized();
    }
    if (!t.is_none())
        rig.source_from_reference.translation =
            numbers_of<Eigen::Vector3d>("t", t, "a (3,) array of numbers");
    rig.validate();
    return rig;
}

std::string text_of(const Pinhole& c) {
    std::ostringstream out;
    out << "Pinhole(width=" << c.width << ", height=" << c.height << ", fx=" << c.fx
        << ", fy=" << c.fy << ", cx=" << c.cx << ", cy=" << c.cy << ", skew=" << c.skew << ")";
    return out.str();
}

// The words that enumerations go by.
template <class Value>
using Words = std::vector<std::pair<Value, const char*>>;
const Words<SearchMode> kSearchModes = {{SearchMode::automatic, "auto"},
                                        {SearchMode::full, "full"},
                                        {SearchMode::local, "local"},
                                        {SearchMode::off, "off"}};
const Words<FlowMode> kFlowModes = {
    {FlowMode::automatic, "auto"}, {FlowMode::on, "on"}, {FlowMode::off, "off"}};
const Words<Occlusion> kOcclusions = {
    {Occlusion::ignore, "ignore"}, {Occlusion::mark, "mark"}, {Occlusion::hide, "hide"}};
const Words<Solver> kSolvers = {{Solver::ceres, "ceres"}, {Solver::adam, "adam"}};

template <class Value>
const char* word_of(Value value, const Words<Value>& words) {
    for (const auto& [known, word] : words)
        if (known == value) return word;
    return "";
}

template <class Value>
Value value_of(const char* field, const std::string& given, const Words<Value>& words) {
    std::string expected;
    for (std::size_t i = 0; i < words.size(); ++i) {
        if (given == words[i].second) return words[i].first;
        expected += (i == 0 ? "" : i + 1 < words.size() ? ", " : " or ");
        expected += words[i].second;
    }
    throw py::value_error(std::string(field) + " is '" + given + "', expected " + expected);
}

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

py::dict time_of(const CalibrationReport& report) {
    const CalibrationTimes& time = report.time;
    return py::dict(py::arg("prepare") = time.prepare, py::arg("search") = time.search,
                    py::arg("warp") = time.warp, py::arg("value") = time.value,
                    py::arg("jacobian") = time.jacobian, py::arg("solver") = time.solver);
}

py::dict dict_of(const CalibrationReport& report) {
    py::list candidates, levels, steps;
    for (const AdamStep& s : report.steps)
        steps.append(py::dict(py::arg("learning_rate") = s.learning_rate,
                              py::arg("image") = s.image, py::arg("flow") = s.flow,
                              py::arg("prior") = s.prior, py::arg("total") = s.total));
    for (const CandidateReport& c : report.candidates)
        candidates.append(
            py::dict(py::arg("score") = c.score, py::arg("correlation") = c.correlation,
                     py::arg("overlap") = c.overlap, py::arg("refined_nec") = c.refined_nec,
                     py::arg("reference_hfov_deg") = c.refined.reference.hfov() / kDegree,
                     py::arg("source_hfov_deg") = c.refined.source.hfov() / kDegree));
    for (const LevelReport& l : report.levels)
        levels.append(
            py::dict(py::arg("factor") = l.factor, py::arg("stage") = l.stage,
                     py::arg("width") = l.width, py::arg("height") = l.height,
                     py::arg("iterations") = l.iterations, py::arg("initial_cost") = l.initial_cost,
                     py::arg("final_cost") = l.final_cost, py::arg("nec") = l.nec,
                     py::arg("aligned") = l.aligned, py::arg("valid_share") = l.valid_share,
                     py::arg("condition_number") = l.condition_number,
                     py::arg("seconds") = l.seconds, py::arg("stopped") = l.stopped));
    return py::dict(
        py::arg("converged") = report.converged, py::arg("message") = report.message,
        py::arg("seconds") = report.seconds, py::arg("time") = time_of(report),
        py::arg("working_width") = report.working_width,
        py::arg("working_height") = report.working_height, py::arg("nec") = report.nec,
        py::arg("baseline_nec") = report.baseline_nec, py::arg("contrast") = report.contrast,
        py::arg("repeatability_px") = report.repeatability_px,
        py::arg("visible_shift_px") = report.visible_shift_px,
        py::arg("valid_share") = report.valid_share, py::arg("frames") = report.frames,
        py::arg("candidates") = candidates, py::arg("levels") = levels, py::arg("steps") = steps);
}

}  // namespace

PYBIND11_MODULE(_core, m) {
    m.doc() = "XCalib's C++ core. Import it as `xcalib`.";

    py::register_exception_translator([](std::exception_ptr p) {
        try {
            if (p) std::rethrow_exception(p);
        } catch (const std::system_error& error) {
            errno = error.code().value();
            // what() begins with the path: "path: reason".
            const std::string what = error.what();
            const std::string path = what.substr(0, what.rfind(": "));
            PyErr_SetFromErrnoWithFilename(PyExc_OSError, path.c_str());
        }
    });

    py::register_exception<InputError>(m, "InputError", PyExc_ValueError).attr("__doc__") =
        "Input that cannot be used; the message names the file or argument and what was expected.";

    py::class_<Pinhole>(m, "Pinhole", R"(A pinhole camera, Eq. (intrinsic) of the paper.

Pixel centres lie at integer coordinates; all lengths in pixels. Fields may be set.)")
        .def(py::init([](int width, int height, double fx, double fy, double cx, double cy,
                         double skew) {
                 const Pinhole camera{width, height, fx, fy, cx, cy, skew};
                 camera.validate("Pinhole");
                 return camera;
             }),
             py::arg("width"), py::arg("height"), py::arg("fx"), py::arg("fy"), py::arg("cx"),
             py::arg("cy"), py::arg("skew") = 0.0,
             "Raises ValueError where a size is below 1, a focal length not > 0, or a value not "
             "finite.")
        .def_static(
            "from_hfov",
            [](int width, int height, double hfov_deg) {
                return Pinhole::from_hfov(width, height, hfov_deg * kDegree);
            },
            py::arg("width"), py::arg("height"), py::arg("hfov_deg"),
            "Square pixels and the principal point at the centre; hfov_deg in (0, 180).")
        .def_readwrite("width", &Pinhole::width, "[px]")
        .def_readwrite("height", &Pinhole::height, "[px]")
        .def_readwrite("fx", &Pinhole::fx, "[px]")
        .def_readwrite("fy", &Pinhole::fy, "[px]")
        .def_readwrite("cx", &Pinhole::cx, "[px]")
        .def_readwrite("cy", &Pinhole::cy, "[px]")
        .def_readwrite("skew", &Pinhole::skew, "[px]")
        .def_property_readonly("K", &Pinhole::K, "(3, 3) float64 intrinsic matrix [px].")
        .def_property_readonly(
            "hfov_deg", [](const Pinhole& c) { return c.hfov() / kDegree; },
            "Horizontal field of view, 2 atan(width / (2 fx)) [deg].")
        .def_property_readonly(
            "vfov_deg", [](const Pinhole& c) { return c.vfov() / kDegree; },
            "Vertical field of view [deg].")
        .def("resized", &Pinhole::resized, py::arg("width"), py::arg("height"),
             "The same camera behind an image of another size [px].")
        .def("__repr__", &text_of);

    py::class_<RelativeDepth>(m, "RelativeDepth",
                              R"(Relative inverse depth r in metres: D = 1 / (scale r + shift).

A rig that was calibrated with it has its translation in the unit that the scale stands for.)")
        .def(py::init([](double scale, double shift) {
                 const RelativeDepth relative{scale, shift};
                 relative.validate("RelativeDepth");
                 return relative;
             }),
             py::arg("scale"), py::arg("shift"),
             "Raises ValueError where the scale is not > 0, or a value not finite.")
        .def_readonly("scale", &RelativeDepth::scale, "> 0")
        .def_readonly("shift", &RelativeDepth::shift, "[1/m], if the scale is of metres.")
        .def("__repr__", [](const RelativeDepth& r) {
            std::ostringstream out;
            out << "RelativeDepth(scale=" << r.scale << ", shift=" << r.shift << ")";
            return out.str();
        });

    py::class_<Rig>(m, "Rig", R"(A reference and a source camera, fixed to each other.

`R` and `t` take points of the reference camera to the source camera: X_S = R X_R + t.)")
        .def(py::init(&make_rig), py::arg("reference"), py::arg("source"),
             py::arg("R") = py::none(), py::arg("t") = py::none(),
             "R: (3, 3) rotation, default identity. t: (3,) [m], default zero. ValueError "
             "otherwise.")
        .def_readwrite("reference", &Rig::reference, "Pinhole that gives the pixel grid.")
        .def_readwrite("source", &Rig::source, "Pinhole whose images are registered.")
        .def_property(
            "R", &Rig::R,
            [](Rig& rig, const Eigen::Matrix3d& R) {
                rig = make_rig(rig.reference, rig.source, py::cast(R), py::cast(rig.t()));
            },
            "(3, 3) float64 rotation, source_from_reference.")
        .def_property(
            "t", [](const Rig& rig) { return rig.t(); },
            [](Rig& rig, const Eigen::Vector3d& t) {
                rig = make_rig(rig.reference, rig.source, py::cast(rig.R()), py::cast(t));
            },
            "(3,) float64 translation, source_from_reference [m].")
        .def_readwrite("relative_depth", &Rig::relative_depth,
                       "RelativeDepth it was calibrated with, or None: metric depth.")
        .def_property_readonly(
            "quaternion_wxyz",
            [](const Rig& rig) {
                const Eigen::Quaterniond& q = rig.source_from_reference.rotation;
                return Eigen::Vector4d(q.w(), q.x(), q.y(), q.z());
            },
            "(4,) float64 unit quaternion of R.")
        .def_property_readonly("infinite_homography", &infinite_homography,
                               "(3, 3) float64, K_S R K_R^-1: where points at infinity go.")
        .def("resized", &Rig::resized, py::arg("reference_width"), py::arg("reference_height"),
             py::arg("source_width"), py::arg("source_height"),
             "The same rig behind images of other sizes [px].")
        .def("fitted", &fitted, py::arg("reference_width"), py::arg("reference_height"),
             py::arg("source_width"), py::arg("source_height"),
             "The rig for images of these sizes [px]: itself, or resized where both have its "
             "aspects, to within a pixel. Raises InputError where one has not.")
        .def(
            "save",
            [](const Rig& rig, const std::filesystem::path& path) { save_rig(rig, path.string()); },
            py::arg("path"), "Writes the rig file, whole or not at all. OSError names the path.")
        .def_static(
            "load", [](const std::filesystem::path& path) { return load_rig(path.string()); },
            py::arg("path"),
            "Reads a rig file. OSError where it cannot be read; ValueError, with the path, the "
            "field "
            "and what was expected, where it is not a rig.")
        .def("__repr__", [](const Rig& rig) {
            std::ostringstream out;
            out << "Rig(reference=" << text_of(rig.reference) << ", source=" << text_of(rig.source)
                << ", t=[" << rig.t().transpose() << "])";
            return out.str();
        });

    py::class_<SearchOptions>(m, "SearchOptions", "The global search that starts a calibration.")
        .def(py::init(&options_from<SearchOptions>))
        .def_property(
            "mode", [](const SearchOptions& o) { return word_of(o.mode, kSearchModes); },
            [](SearchOptions& o, const std::string& word) {
                o.mode = value_of("search mode", word, kSearchModes);
            },
            "auto (full without an initial rig, local with one), full, local or off.")
        .def_readwrite("max_fov_ratio", &SearchOptions::max_fov_ratio,
                       "Largest ratio of the two fields of view, either way, in tangents; > 1.")
        .def_readwrite("max_roll_deg", &SearchOptions::max_roll_deg, "[deg], in [0, 180].")
        .def_readwrite("min_overlap", &SearchOptions::min_overlap,
                       "Geometric mean of the shares of both images' edges, in (0, 1).")
        .def_readwrite("map_width", &SearchOptions::map_width, "Width searched at [px], >= 32.")
        .def_readwrite("candidates", &SearchOptions::candidates,
                       "Peaks refined before one is chosen, >= 1.");

    py::class_<AdamOptions>(m, "AdamOptions",
                            "The published schedule. Keyword arguments set fields.")
        .def(py::init(&options_from<AdamOptions>))
        .def_readwrite("epochs", &AdamOptions::epochs, ">= 1")
        .def_readwrite("batch", &AdamOptions::batch, "Pairs, >= 1.")
        .def_readwrite("learning_rate", &AdamOptions::learning_rate, "Of stage 1, > 0.")
        .def_readwrite("fine_learning_rate", &AdamOptions::fine_learning_rate, "Of stage 2, > 0.")
        .def_readwrite("decay", &AdamOptions::decay, "Of either by a step, in (0, 1].")
        .def_readwrite("fine_from", &AdamOptions::fine_from,
                       "Share of all steps at which stage 2 begins, in [0, 1].")
        .def_readwrite("translation_scales", &AdamOptions::translation_scales,
                       "Of Eq. (translation), 1 to 3.");

    py::class_<Parts>(m, "_Parts", "Parts of the method, for ablation studies: all belong on.")
        .def(py::init(&options_from<Parts>))
        .def_readwrite("images", &Parts::images)
        .def_readwrite("pyramid", &Parts::pyramid)
        .def_readwrite("stages", &Parts::stages)
        .def_readwrite("floor", &Parts::floor)
        .def_readwrite("pair_weights", &Parts::pair_weights)
        .def_readwrite("normalization", &Parts::normalization)
        .def_readwrite("depth_edges", &Parts::depth_edges);

    py::class_<CalibrationOptions>(m, "CalibrationOptions",
                                   "Options of calibrate(). Keyword arguments set fields.")
        .def(py::init(&options_from<CalibrationOptions>))
        .def_readwrite("max_frames", &CalibrationOptions::max_frames,
                       "Pairs used, spread over the footage; >= 1.")
        .def_readwrite("seed", &CalibrationOptions::seed, "Of the frame choice.")
        .def_readwrite("num_threads", &CalibrationOptions::num_threads, "0 uses every core.")
        .def_readwrite("working_width", &CalibrationOptions::working_width,
                       "References are reduced by a whole factor to at most this width [px].")
        .def_readwrite("max_iterations", &CalibrationOptions::max_iterations,
                       "Per stage and level; >= 1.")
        .def_readwrite("prior_weight", &CalibrationOptions::prior_weight,
                       "gamma of Eq. (total_loss), in stage 1; >= 0.")
        .def_property(
            "flow", [](const CalibrationOptions& o) { return word_of(o.flow, kFlowModes); },
            [](CalibrationOptions& o, const std::string& word) {
                o.flow = value_of("flow", word, kFlowModes);
            },
            "The flow term: 'auto' (where nothing is searched), 'on' (after a search too) or "
            "'off'.")
        .def_readwrite("flow_weight", &CalibrationOptions::flow_weight,
                       "lambda of Eq. (total_loss); > 0.")
        .def_readwrite("flow_rounds", &CalibrationOptions::flow_rounds,
                       "Times at most that a stage at a level estimates flow; >= 1.")
        .def_readwrite("reference_camera", &CalibrationOptions::reference_camera,
                       "Known intrinsics, frozen, or None.")
        .def_readwrite("source_camera", &CalibrationOptions::source_camera,
                       "Known intrinsics, frozen, or None.")
        .def_readwrite("reference_hfov_deg", &CalibrationOptions::reference_hfov_deg,
                       "Horizontal field of view to assume [deg], or None to search it.")
        .def_readwrite("optimize_reference", &CalibrationOptions::optimize_reference,
                       "Free the reference's intrinsics too; they are coupled with the source's. "
                       "The solver 'adam' always does.")
        .def_readwrite("relative_depth", &CalibrationOptions::relative_depth,
                       "RelativeDepth that the depth maps were made with: the shift is estimated, "
                       "the scale kept, and the rig has both. None: metric depth.")
        .def_readwrite("search", &CalibrationOptions::search, "SearchOptions.")
        .def_property(
            "solver", [](const CalibrationOptions& o) { return word_of(o.solver, kSolvers); },
            [](CalibrationOptions& o, const std::string& word) {
                o.solver = value_of("solver", word, kSolvers);
            },
            "'ceres', or 'adam' as published, which searches nothing.")
        .def_readwrite("adam", &CalibrationOptions::adam, "AdamOptions.")
        .def_readwrite("_parts", &CalibrationOptions::parts)
        .def("validate", &CalibrationOptions::validate,
             "Raises ValueError naming the field, its value and the allowed range.");

    py::class_<LevelReport>(m, "LevelReport", "One solve: a stage at a level of the pyramid.")
        .def_readonly("factor", &LevelReport::factor, "Reduction of the working images.")
        .def_readonly("stage", &LevelReport::stage, "1 or 2, as in the paper.")
        .def_readonly("width", &LevelReport::width, "[px]")
        .def_readonly("height", &LevelReport::height, "[px]")
        .def_readonly("iterations", &LevelReport::iterations, "Of Levenberg-Marquardt.")
        .def_readonly("initial_cost", &LevelReport::initial_cost,
                      "Eq. (image_loss), and, where they act, the flow term and the prior.")
        .def_readonly("final_cost", &LevelReport::final_cost, "The same at the end.")
        .def_readonly("nec", &LevelReport::nec, "Mean over the pairs, weighted by c_i.")
        .def_readonly("aligned", &LevelReport::aligned, "The same, beyond what chance gives.")
        .def_readonly("valid_share", &LevelReport::valid_share,
                      "Share of the reference's edge energy that the source covers.")
        .def_readonly("condition_number", &LevelReport::condition_number,
                      "Of the normal equations, columns scaled to unit norm.")
        .def_readonly("seconds", &LevelReport::seconds, "[s]")
        .def_readonly("stopped", &LevelReport::stopped, "Why it stopped.");

    py::class_<CandidateReport>(m, "CandidateReport",
                                "A peak of the search, and what became of it.")
        .def_readonly("score", &CandidateReport::score, "Contrast against the typical value.")
        .def_readonly("correlation", &CandidateReport::correlation,
                      "Pooled over the frames, of doubled angles, in [-1, 1].")
        .def_readonly("overlap", &CandidateReport::overlap, "Of both images' edges.")
        .def_readonly("refined_nec", &CandidateReport::refined_nec, "After the coarse levels.")
        .def_readonly("found", &CandidateReport::found, "Rig, by the search.")
        .def_readonly("refined", &CandidateReport::refined, "Rig, after the coarse levels.");

    py::class_<AdamStep>(m, "AdamStep", "Before a step of Adam is taken: means over its batch.")
        .def_readonly("learning_rate", &AdamStep::learning_rate, "Of the step.")
        .def_readonly("image", &AdamStep::image, "Eq. (image_loss).")
        .def_readonly("flow", &AdamStep::flow, "Eq. (flow_loss), in half widths of the reference.")
        .def_readonly("prior", &AdamStep::prior, "Eq. (camera_regularization).")
        .def_readonly("total", &AdamStep::total, "Eq. (total_loss).");

    py::class_<CalibrationReport>(m, "CalibrationReport", "How a calibration went.")
        .def_readonly("converged", &CalibrationReport::converged, "Is the rig to be trusted?")
        .def_readonly("message", &CalibrationReport::message, "Why, in one line.")
        .def_readonly("seconds", &CalibrationReport::seconds, "[s]")
        .def_property_readonly(
            "time", &time_of,
            "Where they go [s]: `prepare` (working images and their pyramid), `search`, `warp`\n"
            "(reprojection and sampling of the passes over image pairs), `value` (the rest of the\n"
            "passes without derivatives), `jacobian` (the rest of those with them), `solver` "
            "(Ceres\n"
            "itself). Of what threads do side by side, their sum divided by their number.")
        .def_readonly("working_width", &CalibrationReport::working_width, "[px]")
        .def_readonly("working_height", &CalibrationReport::working_height, "[px]")
        .def_readonly("nec", &CalibrationReport::nec, "At the finest level.")
        .def_readonly("baseline_nec", &CalibrationReport::baseline_nec,
                      "Typical of rigs displaced by many pixels.")
        .def_readonly("contrast", &CalibrationReport::contrast,
                      "Of the NEC above the baseline, in deviations over displacements.")
        .def_readonly("repeatability_px", &CalibrationReport::repeatability_px,
                      "Median distance between fits to two halves of the frames [working px].")
        .def_readonly(
            "visible_shift_px", &CalibrationReport::visible_shift_px,
            "Of the shift, linear over the image, that flow between the registered images\n"
            "still sees: the length that 90 % of the pixels do not exceed [working px];\n"
            "NaN where it cannot tell.")
        .def_readonly("valid_share", &CalibrationReport::valid_share,
                      "Of the reference's edge energy.")
        .def_readonly("frames", &CalibrationReport::frames, "Indices of the pairs used.")
        .def_readonly("candidates", &CalibrationReport::candidates,
                      "Of the search, best score first.")
        .def_readonly("levels", &CalibrationReport::levels, "In the order solved.")
        .def_readonly("steps", &CalibrationReport::steps, "AdamStep, of solver 'adam'.")
        .def("brief", &CalibrationReport::brief, "One line.")
        .def("full", &CalibrationReport::full, "A table.")
        .def("to_dict", &dict_of, "Plain lists and numbers, as for JSON.");

    py::class_<CalibrationResult>(m, "CalibrationResult", "What calibrate() returns.")
        .def_readonly("rig", &CalibrationResult::rig, "The best rig found.")
        .def_readonly("converged", &CalibrationResult::converged, "Is it to be trusted?")
        .def_readonly("report", &CalibrationResult::report, "CalibrationReport.");

    m.def("draw_frames", &draw_frames, py::arg("count"), py::arg("max_frames"), py::arg("seed"),
          "Indices of max_frames of count frames, spread over all, drawn with seed; sorted.");

    m.def(
        "calibrate",
        [](const py::sequence& references, const py::sequence& sources, const py::sequence& depths,
           const std::optional<Rig>& initial, const CalibrationOptions& options,
           const py::object& progress, const py::object& flow) {
            const HeldList r = list_of("reference", references, image_of);
            const HeldList s = list_of("source", sources, image_of);
            const HeldList d =
                list_of("depth", depths, [](const std::string& name, const py::object& depth) {
                    return depth_of(name, depth);
                });
            const Progress tell = [&progress](const std::string& stage, double share) {
                const py::gil_scoped_acquire gil;
                if (PyErr_CheckSignals() != 0) throw py::error_already_set();  // Ctrl-C
                if (!progress.is_none()) progress(stage, share);
            };
            FlowEstimator estimator;
            if (!flow.is_none())
                estimator = [&flow](const Image& reference, const Image& warped,
                                    const std::vector<std::uint8_t>& valid) {
                    const py::gil_scoped_acquire gil;
                    const auto array = [&](const auto& values) {
                        return array_of(values, reference.width, reference.height);
                    };
                    return field_from(
                        flow(array(reference.pixels), array(warped.pixels), array(valid)),
                        reference.width, reference.height);
                };
            const py::gil_scoped_release unlocked;
            return calibrate(r.views, s.views, d.views, initial, options, tell, estimator);
        },
        py::arg("references"), py::arg("sources"), py::arg("depths"),
        py::arg("initial") = py::none(), py::arg("options") = CalibrationOptions{},
        py::arg("progress") = py::none(), py::arg("flow") = py::none(),
        R"(Estimates the rig from footage and depth, without a target.

references, sources: sequences of (H, W) or (H, W, 3) uint8 | uint16 | float32 images, pairs by
index; depths: (h, w) float32 [m], any size of the reference's aspect, 0 / NaN / inf unknown.
initial: Rig to start from. progress: called with (stage, share of the work done). flow: a
provider as in xcalib.flow, for the flow term; None is the built-in patch flow.
Images are copied only where they are not contiguous and aligned.

Raises ValueError, naming the frame, on unusable input. Not to converge is a result:
see CalibrationResult.converged.)");

    py::class_<Registrar>(m, "Registrar", R"(One rig, a stream of frames, Eq. (warping).

num_threads: 0 uses every core. nearest: register() takes the source pixel next to the point as it
is, instead of interpolating between four, so that radiometric counts are never mixed. occlusion,
what the source camera sees something nearer in front of: "mark" gives it mask code 2, and the image
shows what is in front; "hide" makes it 0 in the image and NaN in the map too, so that nothing is
seen twice; "ignore" does not look for it. depth_scale: metres per unit of uint16 depth (1 / 256 is KITTI's), 0 unknown; None
refuses integers. Raises ValueError where the rig or an option is not valid.)")
        .def(py::init([](const Rig& rig, int num_threads, bool nearest,
                         const std::string& occlusion, const std::optional<double>& depth_scale) {
                 if (depth_scale && !(std::isfinite(*depth_scale) && *depth_scale > 0))
                     throw py::value_error("depth_scale is " + std::to_string(*depth_scale) +
                                           ", expected metres per unit, > 0, or None");
                 return Registrar(
                     rig, {num_threads, nearest, value_of("occlusion", occlusion, kOcclusions),
                           depth_scale.value_or(0)});
             }),
             py::arg("rig"), py::arg("num_threads") = 0, py::arg("nearest") = false,
             py::arg("occlusion") = "mark", py::arg("depth_scale") = py::none())
        .def_property_readonly("rig", &Registrar::rig, "A copy of the rig.",
                               py::return_value_policy::copy)
        .def(
            "map",
            [](const Registrar& registrar, const py::object& depth) {
                const Held d = depth_of("depth", depth, registrar.options().depth_scale > 0);
                const Pinhole& grid = registrar.rig().reference;
                py::array_t<float> out({grid.height, grid.width, 2});
                float* data = out.mutable_data();
                {
                    const py::gil_scoped_release unlocked;
                    registrar.map(d.view, data);
                }
                return out;
            },
            py::arg("depth"),
            "(H, W, 2) float32: x and y in the source image [px] of each reference pixel, NaN "
            "where it is not valid. depth: as in register().")
        .def(
            "register",
            [](const Registrar& registrar, const py::object& source, const py::object& depth,
               const py::object& out, const py::object& mask) {
                const Held s = image_of("source", source);
                const Held d = depth_of("depth", depth, registrar.options().depth_scale > 0);
                const Pinhole& grid = registrar.rig().reference;
                std::vector<py::ssize_t> shape{grid.height, grid.width};
                py::array codes = result_of("mask", mask, py::dtype::of<std::uint8_t>(), shape,
                                            {{"source", s.array}, {"depth", d.array}});
                if (s.array.ndim() == 3) shape.push_back(s.array.shape(2));
                py::array image =
                    result_of("out", out, s.array.dtype(), shape,
                              {{"source", s.array}, {"depth", d.array}, {"mask", codes}});
                const MutableImageView pixels{
                    image.mutable_data(),
                    grid.width,
                    grid.height,
                    s.view.channels,
                    s.view.type,
                    static_cast<std::ptrdiff_t>(grid.width * s.view.channels * image.itemsize())};
                auto* written = static_cast<std::uint8_t*>(codes.mutable_data());
                {
                    const py::gil_scoped_release unlocked;
                    registrar.register_frame(s.view, d.view, pixels, written);
                }
                return py::make_tuple(image, codes);
            },
            py::arg("source"), py::arg("depth"), py::arg("out") = py::none(),
            py::arg("mask") = py::none(),
            R"(The source on the reference grid, and what each pixel is worth.

source: (h, w) or (h, w, 3) uint8 | uint16 | float32 of the rig's source size; depth: (h, w) float32
[m], or uint16 if depth_scale was given, of the reference's aspect. out, mask: contiguous arrays to
write the results to, which overlap no other; else new ones are made, which for large
images takes as long as filling them. Returns (image, mask): image (H, W[, 3]) in the source's
dtype, 0 where not valid, unless marked as occluded only; mask (H, W) uint8: 0 valid, 1 outside the
source, 2 occluded, 3 no depth.
Raises ValueError with shapes and dtypes.)");

    m.def(
        "nec",
        [](const py::object& a, const py::object& b, const py::object& mask,
           const std::string& floor) {
            if (floor != "none" && floor != "printed")
                throw py::value_error("floor is '" + floor + "', expected none or printed");
            const Compared c = compared(a, b, mask);
            const py::gil_scoped_release unlocked;
            return nec(c.reference, c.registered, c.valid,
                       floor == "printed" ? NecFloor::printed : NecFloor::none);
        },
        py::arg("reference"), py::arg("registered"), py::arg("mask") = py::none(),
        py::arg("floor") = "none",
        R"(Normalized Edge Correlation, Eq. (nec), in [0, 1]; NaN where no edge is left.

Images (H, W) or (H, W, 3) of one size; mask (H, W), nonzero where valid. floor: "none" (upper clamp
only, as the authors' code) or "printed" (Eq. (gradient_clamping) as printed).)");
    const auto metric = [&m](const char* name, auto function, const char* doc) {
        m.def(
            name,
            [function](const py::object& a, const py::object& b, const py::object& mask) {
                const Compared c = compared(a, b, mask);
                const py::gil_scoped_release unlocked;
                return function(c.reference, c.registered, c.valid);
            },
            py::arg("reference"), py::arg("registered"), py::arg("mask") = py::none(), doc);
    };
    metric("gc", &gc,
           "Gradient correlation: mean over x and y of the zero-mean normalized correlation "
           "of the absolute forward differences, in [-1, 1]. Images and mask as in nec().");
    metric("ncc", &ncc,
           "Zero-mean normalized cross correlation, in [-1, 1]. Images and mask as in nec().");
    metric("rmse", &rmse,
           "Root mean square error of gray values; integers scaled to [0, 1]. Images "
           "and mask as in nec().");
    const auto ranged = [&m](const char* name, auto function, const char* doc) {
        m.def(
            name,
            [function](const py::object& a, const py::object& b, const py::object& mask,
                       const py::object& data_range) {
                const Compared c = compared(a, b, mask);
                const double range = range_of(data_range);
                const py::gil_scoped_release unlocked;
                return function(c.reference, c.registered, c.valid, range);
            },
            py::arg("reference"), py::arg("registered"), py::arg("mask") = py::none(),
            py::arg("data_range") = py::none(), doc);
    };
    ranged("ssim", &ssim,
           "Structural similarity (Wang et al. 2004), Gaussian window of sigma 1.5 px, "
           "over pixels whose 11 x 11 window is valid. data_range: span of the gray "
           "values, 1 by default. Images and mask as in nec().");
    ranged("psnr", &psnr,
           "Peak signal-to-noise ratio [dB], 20 log10(data_range / RMSE). Images, mask "
           "and data_range as in ssim().");

    m.def(
        "patch_shifts",
        [](const py::object& a, const py::object& b, const py::object& mask) {
            const Compared c = compared(a, b, mask);
            std::vector<PatchShift> shifts;
            {
                const py::gil_scoped_release unlocked;
                shifts = patch_residual(c.reference, c.registered, c.valid);
            }
            py::array_t<float> out({static_cast<py::ssize_t>(shifts.size()), py::ssize_t{4}});
            auto rows = out.mutable_unchecked<2>();
            for (std::size_t i = 0; i < shifts.size(); ++i) {
                const PatchShift& s = shifts[i];
                const float row[4] = {s.center_x, s.center_y, s.dx, s.dy};
                for (int k = 0; k < 4; ++k) rows(static_cast<py::ssize_t>(i), k) = row[k];
            }
            return out;
        },
        py::arg("reference"), py::arg("registered"), py::arg("mask") = py::none(),
        "(N, 4) float32: centre x, y and residual shift dx, dy [px] of the patches that tell; see "
        "metrics.patch_residual().");

    py::class_<FlowOptions>(m, "FlowOptions", "Options of patch_flow().")
        .def(py::init(&options_from<FlowOptions>))
        .def_readwrite("step", &FlowOptions::step, "Of the grid of patches [px], odd, >= 3.")
        .def_readwrite("patch", &FlowOptions::patch,
                       "Side of a patch [px], an odd multiple of the step.")
        .def_readwrite("levels", &FlowOptions::levels, "Of the pyramid, >= 1.")
        .def_readwrite("max_shift", &FlowOptions::max_shift,
                       "Farthest shift that the coarsest level looks for [px], >= 1.")
        .def("validate", &FlowOptions::validate,
             "Raises ValueError naming the field, its value and the allowed range.");

    m.def(
        "patch_flow",
        [](const py::object& a, const py::object& b, const py::object& mask,
           const FlowOptions& options, int num_threads) {
            const Compared c = compared(a, b, mask);
            const int width = c.reference.width, height = c.reference.height;
            py::array_t<float> flow({height, width, 2}), confidence({height, width});
            float* const vectors = flow.mutable_data();
            float* const sure = confidence.mutable_data();
            {
                const py::gil_scoped_release unlocked;
                const FlowField field =
                    patch_flow(c.reference, c.registered, c.valid, options, num_threads);
                const Image x = at_every_pixel(field, field.x, width, height);
                const Image y = at_every_pixel(field, field.y, width, height);
                for (std::size_t i = 0; i < x.pixels.size(); ++i) {
                    vectors[2 * i] = x.pixels[i];
                    vectors[2 * i + 1] = y.pixels[i];
                }
                const Image told = at_every_pixel(field, field.confidence, width, height);
                std::copy(told.pixels.begin(), told.pixels.end(), sure);
            }
            return py::make_tuple(flow, confidence);
        },
        py::arg("reference"), py::arg("warped"), py::arg("mask") = py::none(),
        py::arg("options") = FlowOptions{}, py::arg("num_threads") = 0,
        R"(Residual flow between a reference and a warped source of another modality.

Images (H, W) or (H, W, 3) of one size; mask (H, W), nonzero where the warped source is valid.
Returns (flow, confidence): flow (H, W, 2) float32 [px], what reference pixel p shows is found at
p + flow[p] in the warped source; confidence (H, W) float32 in [0, 1]. Both are linear between the
grid's points. num_threads: 0 uses every core; the result does not depend on it.
Raises ValueError with shapes and dtypes.)");

    bind_footage(m);
    bind_evaluation(m);
}

// The Python module: it converts and calls, nothing else.
#include "bindings.hpp"

#include <system_error>

#include "xcalib/error.hpp"

namespace py = pybind11;

// OSError with the path and the errno of a file that cannot be read or written.
static void translate_system_error(std::exception_ptr p) {
    try {
        if (p) std::rethrow_exception(p);
    } catch (const std::system_error& error) {
        errno = error.code().value();
        // what() begins with the path: "path: reason".
        const std::string what = error.what();
        const std::string path = what.substr(0, what.rfind(": "));
        PyErr_SetFromErrnoWithFilename(PyExc_OSError, path.c_str());
    }
}

PYBIND11_MODULE(_core, m) {
    m.doc() = "XCalib's C++ core. Import it as `xcalib`.";
    py::register_exception_translator(&translate_system_error);
    py::register_exception<xcalib::InputError>(m, "InputError", PyExc_ValueError).attr("__doc__") =
        "Input that cannot be used; the message names the file or argument and what was expected.";

    py::register_exception<xcalib::DecodeError>(m, "DecodeError", m.attr("InputError"))
        .attr("__doc__") = "A file that cannot be decoded: truncated, or not what its name says.";

    // In this order: signatures name the classes that are known by then.
    xcalib::bind_verdict(m);
    xcalib::bind_lens(m);
    xcalib::bind_camera(m);
    xcalib::bind_calibration_options(m);
    xcalib::bind_calibration_report(m);
    xcalib::bind_calibrate(m);
    xcalib::bind_register(m);
    xcalib::bind_metrics(m);
    xcalib::bind_flow(m);

    xcalib::bind_pairing(m);
    xcalib::bind_clock_offset(m);
    xcalib::bind_fingerprint(m);
    xcalib::bind_choose(m);
    xcalib::bind_false_colour(m);

    xcalib::bind_flir(m);
    xcalib::bind_plane_depth(m);
    xcalib::bind_fit_plane(m);
    xcalib::bind_depth_units(m);
    xcalib::bind_complete_depth(m);
    xcalib::bind_steady_depth(m);

    xcalib::bind_stream(m);
    xcalib::bind_transfer(m);
    xcalib::bind_sequence(m);
    xcalib::bind_pairs(m);
    xcalib::bind_frames(m);
    xcalib::bind_lags(m);
    xcalib::bind_straightened(m);
    xcalib::bind_files(m);
    xcalib::bind_register_frames(m);

    xcalib::bind_evaluate(m);
    xcalib::bind_describe(m);
    xcalib::bind_documents(m);
    xcalib::bind_overlay(m);

    py::module_::import("xcalib.wrong_calls").attr("explain_in")(m);
}

// The parts of the module: a file for each header of the core, which converts and calls, and
// nothing else.
#pragma once

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>  // here for all parts: without it a list fails only when it is returned

namespace xcalib {

void bind_verdict(pybind11::module_& m);
void bind_lens(pybind11::module_& m);
void bind_camera(pybind11::module_& m);
void bind_calibration_options(pybind11::module_& m);
void bind_calibration_report(pybind11::module_& m);
void bind_calibrate(pybind11::module_& m);
void bind_register(pybind11::module_& m);
void bind_metrics(pybind11::module_& m);
void bind_flow(pybind11::module_& m);

void bind_pairing(pybind11::module_& m);
void bind_clock_offset(pybind11::module_& m);
void bind_files(pybind11::module_& m);
void bind_fingerprint(pybind11::module_& m);
void bind_choose(pybind11::module_& m);
void bind_false_colour(pybind11::module_& m);

void bind_flir(pybind11::module_& m);
void bind_plane_depth(pybind11::module_& m);
void bind_fit_plane(pybind11::module_& m);
void bind_depth_units(pybind11::module_& m);
void bind_complete_depth(pybind11::module_& m);
void bind_steady_depth(pybind11::module_& m);

void bind_stream(pybind11::module_& m);
void bind_transfer(pybind11::module_& m);
void bind_pairs(pybind11::module_& m);
void bind_sequence(pybind11::module_& m);
void bind_frames(pybind11::module_& m);
void bind_lags(pybind11::module_& m);
void bind_straightened(pybind11::module_& m);
void bind_register_frames(pybind11::module_& m);

void bind_evaluate(pybind11::module_& m);
void bind_describe(pybind11::module_& m);
void bind_documents(pybind11::module_& m);
void bind_overlay(pybind11::module_& m);

}  // namespace xcalib

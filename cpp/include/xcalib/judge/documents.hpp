// What the commands write for machines: JSON, indented, keys in a fixed order, null for what is not
// finite. `rig_file` and `files` name what a document is about.
#pragma once

#include <string>
#include <vector>

#include "xcalib/calibration_report.hpp"
#include "xcalib/export.hpp"
#include "xcalib/judge/evaluate.hpp"

namespace XCALIB_EXPORT xcalib {

// format: xcalib-report, version: 1. `files`: those of the report's frames.
std::string report_document(const CalibrationReport& report, const std::string& rig_file,
                            const std::vector<std::string>& files);

std::string evaluation_document(const Evaluation& evaluation, const std::string& rig_file,
                                const std::vector<std::string>& files);

// The parameters of a rig, and what describe() makes of them; without a line break at the end.
std::string rig_document(const Rig& rig);

}  // namespace xcalib

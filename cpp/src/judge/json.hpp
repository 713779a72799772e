// Facts as JSON values: numbers that are not finite are kept, and become null in text.
#pragma once

#include <nlohmann/json.hpp>

#include "xcalib/calibration_report.hpp"
#include "xcalib/export.hpp"
#include "xcalib/judge/evaluate.hpp"

namespace XCALIB_EXPORT xcalib {

using Json = nlohmann::ordered_json;

Json json_of(const CalibrationReport& report);
Json json_of(const Scores& scores);
Json json_of(const Evaluation& evaluation);
Json json_of(const Rig& rig);

}  // namespace xcalib

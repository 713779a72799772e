// Calibration: frames and depth in, one rig and a report out.
//
//     frames -> working images -> search -> pyramid (stage 1, stage 2) -> rig, verdict
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "xcalib/calibration_options.hpp"
#include "xcalib/calibration_report.hpp"
#include "xcalib/camera.hpp"
#include "xcalib/export.hpp"
#include "xcalib/flow.hpp"
#include "xcalib/image.hpp"

namespace XCALIB_EXPORT xcalib {

struct CalibrationResult {
    Rig rig;
    bool converged = false;
    CalibrationReport report;

    // For what is found out about the footage later. The report's message keeps what it said.
    void distrust(const std::string& reason, const std::string& advice);
};

// Called with the stage and the share of all work done, (0, 1], from the calling thread.
using Progress = std::function<void(const std::string&, double)>;

// references[i], sources[i], depths[i] belong together; each list of one size (depth: any size of
// the reference's aspect, float32 metres in the reference camera, 0 / NaN / inf unknown).
// Throws std::invalid_argument, naming the frame, on unusable input. Not to converge is a result.
CalibrationResult calibrate(const std::vector<ImageView>& references,
                            const std::vector<ImageView>& sources,
                            const std::vector<ImageView>& depths,
                            const std::optional<Rig>& initial = std::nullopt,
                            const CalibrationOptions& options = {},
                            const Progress& progress = nullptr,
                            const FlowEstimator& flow = nullptr);

// How far off each pixel of the reference is expected to be at a depth [m]: the length that `share`
// of errors there, (0, 1), do not exceed [px of the reference when its width is 640 px], drawn on a
// grid of this size that covers the image. NaN where the source sees nothing of it.
Image expected_error_map(const CalibrationReport& report, double depth, int width, int height,
                         double share = 0.5);

}  // namespace xcalib

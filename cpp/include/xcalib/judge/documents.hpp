// What the commands write for machines: JSON, indented, keys in a fixed order, null for what is not
// finite. `rig_file` and `files` name what a document is about.
#pragma once

#include <string>
#include <vector>

#include "xcalib/calibration_report.hpp"
#include "xcalib/export.hpp"
#include "xcalib/judge/evaluate.hpp"

namespace XCALIB_EXPORT xcalib {

// How a calibration was started, so that it can be repeated and its frames be found again.
struct RunFacts {
    struct Frame {
        std::string file;
        bool taken = false;
        std::string reason;  // why it was taken or left
    };
    std::string program;                 // xcalib or xcalib-cli
    std::vector<std::string> arguments;  // after the program
    std::string directory;               // that it ran in
    int lag = 0;                         // of the sources, that was taken up [frames]
    std::vector<Frame> choice;           // the frames looked at; none where they were drawn blindly
};

// format: xcalib-report, version: 1. `files`: those of the report's frames.
std::string report_document(const CalibrationReport& report, const std::string& rig_file,
                            const std::vector<std::string>& files, const RunFacts& run);

std::string evaluation_document(const Evaluation& evaluation, const std::string& rig_file,
                                const std::vector<std::string>& files);

// The parameters of a rig, and what describe() makes of them; without a line break at the end.
std::string rig_document(const Rig& rig);

}  // namespace xcalib

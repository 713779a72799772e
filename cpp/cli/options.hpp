// The arguments that commands share, as on the Python command line.
#pragma once

#include <initializer_list>
#include <optional>
#include <string>

#include "xcalib/depth/complete_depth.hpp"
#include "xcalib/depth/depth_units.hpp"
#include "xcalib/depth/plane_depth.hpp"
#include "xcalib/footage/sequence.hpp"

namespace CLI {
class App;
class Validator;
}  // namespace CLI

namespace xcalib::cli {

struct DepthArguments {
    std::string spec;
    DepthUnits units;
    std::string stereo_calibration;  // a file with the three numbers of disparities
    PlaneDepth plane;
    bool steady = false, complete = false;
    double completion_confidence = kCompletionConfidence;
};

struct FrameArguments {
    std::string reference, source;
    DepthArguments depth;
    std::string pairing = "auto";
    TimeOffset time_offset;
    std::optional<double> max_gap;
    std::string reference_times, source_times;
    std::string exif_orientation = "ignore";
    std::string source_readout = "0", reference_readout = "0";
    bool dry_run = false;
};

// The depth options that few need: the last in the help.
void add_rare_depth(CLI::App& command, DepthArguments& arguments);

// REFERENCE, SOURCE and how they and their depth are read.
void add_frames(CLI::App& command, FrameArguments& arguments);
// Refuses an empty name, which stands for a folder elsewhere: for a variable that is not set.
extern const CLI::Validator kNamed;
void add_threads(CLI::App& command, int& threads);
void add_colormap(CLI::App& command, std::string& colormap);

// Options that only the Python command has: they are known here, and refused with its name.
void add_python_only(CLI::App& command, std::initializer_list<const char*> options,
                     const std::string& what);

}  // namespace xcalib::cli

#include "options.hpp"

#include <CLI/CLI.hpp>

#include "xcalib/error.hpp"
#include "xcalib/footage/pairing.hpp"
#include "xcalib/threads.hpp"

namespace xcalib::cli {
namespace {

void add_depth(CLI::App& command, DepthArguments& arguments) {
    command
        .add_option("--depth", arguments.spec,
                    "Folder with a depth map per reference image (16-bit PNG; .npy, .tiff, .exr"
                    " in m; 0 unknown), or `plane` for a flat road.")
        ->type_name("DEPTH")
        ->check(kNamed);
    command.add_option("--depth-scale", arguments.scale, "Metres per count of 16-bit PNG depth.")
        ->type_name("M")
        ->default_str("1/256");
    const auto number = [&command](const char* flag, double& value, const char* unit,
                                   const char* text) {
        command.add_option(flag, value, text)->type_name(unit)->capture_default_str();
    };
    number("--camera-height", arguments.plane.camera_height, "M",
           "Plane: height of the reference camera above the road [m].");
    number("--horizon", arguments.plane.horizon, "F",
           "Plane: row of the horizon [fraction of the image height from the top].");
    number("--far", arguments.plane.far, "M",
           "Plane: largest depth, at and above the horizon too [m].");
    number("--plane-hfov", arguments.plane.hfov_deg, "DEG",
           "Plane: horizontal field of view of the reference camera [deg].");
    number("--plane-roll", arguments.plane.roll_deg, "DEG",
           "Plane: how far the horizon falls towards the right [deg].");
    command.add_flag("--depth-steady", arguments.steady,
                     "Average depth over consecutive frames of a video.");
    command.add_flag("--complete", arguments.complete, "Fill unknown depth along image edges.");
    number("--completion-confidence", arguments.completion_confidence, "F",
           "Complete: filled pixels below this confidence stay unknown, 0 to 1.");
    add_python_only(
        command,
        {"--depth-recipe", "--depth-focal", "--inverse-scale", "--inverse-shift", "--providers"},
        "networks are run");
    add_python_only(command, {"--lidar-calibration"}, "lidar scans are read");
    add_python_only(
        command, {"--stereo-calibration", "--stereo-baseline", "--stereo-focal", "--stereo-doffs"},
        "stereo partners are matched");
}

void add_footage(CLI::App& command, FrameArguments& arguments) {
    command
        .add_option("--pair", arguments.pairing,
                    "Pair frames by name, order or time; auto: by time where both have times.")
        ->type_name("HOW")
        ->check(
            CLI::IsMember(std::vector<std::string>(kPairingMethods.begin(), kPairingMethods.end())))
        ->capture_default_str();
    command
        .add_option_function<std::string>(
            "--time-offset",
            [&arguments](const std::string& text) {
                arguments.time_offset = parse_time_offset(text);
            },
            "By how much the source's clock is late: seconds, source frames (`2f`), or `auto`:"
            " from the footage, and from its registration.")
        ->type_name("S")
        ->default_str("0");
    command
        .add_option("--max-gap", arguments.max_gap,
                    "Largest distance in time of a pair [s].  [default: half the slower one's"
                    " period]")
        ->type_name("S")
        ->check(CLI::PositiveNumber);
    command
        .add_option("--reference-times", arguments.reference_times,
                    "Times of the reference frames: lines `name timestamp`.  [default: their own]")
        ->type_name("FILE")
        ->check(kNamed);
    command
        .add_option("--source-times", arguments.source_times,
                    "Times of the source frames: lines `name timestamp`.  [default: their own]")
        ->type_name("FILE")
        ->check(kNamed);
    command
        .add_option("--exif-orientation", arguments.exif_orientation,
                    "Image files that say how their picture is to be turned: take pixels as they"
                    " are stored (ignore), or turn them (apply).")
        ->type_name("HOW")
        ->check(CLI::IsMember({"ignore", "apply"}))
        ->capture_default_str();
}

}  // namespace

const CLI::Validator kNamed(
    [](std::string& name) {
        return name.empty() ? "the name is empty, expected a file or a folder" : std::string();
    },
    "", "named");

void add_frames(CLI::App& command, FrameArguments& arguments) {
    command.add_option("REFERENCE", arguments.reference)->required()->check(kNamed);
    command.add_option("SOURCE", arguments.source)->required()->check(kNamed);
    add_depth(command, arguments.depth);
    add_footage(command, arguments);
}

void add_threads(CLI::App& command, int& threads) {
    command.add_option("--threads", threads, "Threads to use; 0 means all cores.")
        ->type_name("N")
        ->check(CLI::Range(0, kMaxThreads))
        ->capture_default_str();
}

void add_colormap(CLI::App& command, std::string& colormap) {
    command
        .add_option("--source-colormap", colormap,
                    "False-colour source images: turn them back to numbers if they are (auto),"
                    " never (none), or by a map of that name (inferno, jet, iron, ...).")
        ->type_name("MAP")
        ->capture_default_str();
}

void add_python_only(CLI::App& command, std::initializer_list<const char*> options,
                     const std::string& what) {
    for (const char* option : options)
        command
            .add_option_function<std::string>(
                option,
                [option, what](const std::string&) {
                    throw InputError(std::string(option) + ": " + what +
                                     " by the Python command, `xcalib`");
                },
                "")
            ->group("");
}

}  // namespace xcalib::cli

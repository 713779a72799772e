#include "options.hpp"

#include <CLI/CLI.hpp>

#include "xcalib/error.hpp"
#include "xcalib/footage/pairing.hpp"
#include "xcalib/threads.hpp"

namespace xcalib::cli {
namespace {

void group(CLI::App& command, const char* title, std::initializer_list<const char*> options) {
    for (const char* option : options) command.get_option(option)->group(title);
}

void add_depth(CLI::App& command, DepthArguments& arguments) {
    command
        .add_option(
            "--depth", arguments.spec,
            "Folder with a depth map per reference image (16-bit PNG; .npy, .npz, .pfm, .tiff,"
            " .exr in m; 0 unknown), `disparity:FOLDER`, `plane` for a flat road, or one"
            " distance in metres.")
        ->type_name("DEPTH")
        ->check(kNamed);
    CLI::Option* const scale =
        command
            .add_option("--depth-scale", arguments.units.scale,
                        "Metres per count of depth maps (px of disparities).  [default: 1/256 of"
                        " 16-bit PNG, 1 of floats]")
            ->type_name("M");
    command
        .add_option_function<std::string>(
            "--depth-unit",
            [&arguments, scale](const std::string& word) {
                if (!scale->empty())
                    throw InputError(
                        "--depth-unit and --depth-scale both say the unit, expected one of them");
                arguments.units.scale = depth_unit_of(word);
            },
            "The same in words: mm, cm, m, or 1/256 of a metre.")
        ->type_name("UNIT");
    command
        .add_option("--depth-invalid", arguments.units.invalid,
                    "Numbers of depth maps that mean unknown, besides 0, NaN and 65535.")
        ->type_name("N[,N]")
        ->delimiter(',')
        ->allow_extra_args(false);
    command.add_flag("--depth-steady", arguments.steady,
                     "Average depth over consecutive frames of a video.");
    command.add_flag("--complete", arguments.complete, "Fill unknown depth along image edges.");
    group(command, "Depth",
          {"--depth", "--depth-scale", "--depth-unit", "--depth-invalid", "--depth-steady",
           "--complete"});
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
    const auto readout = [&command](const char* flag, const char* camera, std::string& share) {
        command
            .add_option(flag, share,
                        std::string("Rolling shutter of the ") + camera +
                            ": the time from its first row to its last, as a share of that from"
                            " frame to frame, 0 to 1; auto: calibrate finds it from what moves.")
            ->type_name("SHARE")
            ->capture_default_str();
    };
    readout("--source-readout", "source", arguments.source_readout);
    readout("--reference-readout", "reference", arguments.reference_readout);
    group(command, "Footage and pairing",
          {"--pair", "--time-offset", "--max-gap", "--reference-times", "--source-times",
           "--exif-orientation", "--source-readout", "--reference-readout"});
}

}  // namespace

void add_rare_depth(CLI::App& command, DepthArguments& arguments) {
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
    command
        .add_option("--stereo-baseline", arguments.units.baseline,
                    "Disparity: distance of the two visible cameras [m].")
        ->type_name("M");
    command
        .add_option("--stereo-focal", arguments.units.focal,
                    "Disparity: focal length of the rectified images [px].")
        ->type_name("PX");
    command
        .add_option("--stereo-doffs", arguments.units.doffs,
                    "Disparity: principal point of the right camera minus the left's [px]."
                    "  [default: 0]")
        ->type_name("PX");
    command
        .add_option("--stereo-calibration", arguments.stereo_calibration,
                    "Disparity: YAML file with `baseline` [m], `focal` [px] and `doffs` [px].")
        ->type_name("FILE")
        ->check(kNamed);
    number("--completion-confidence", arguments.completion_confidence, "F",
           "Complete: filled pixels below this confidence stay unknown, 0 to 1.");
    add_python_only(
        command,
        {"--depth-recipe", "--depth-focal", "--inverse-scale", "--inverse-shift", "--providers"},
        "networks are run");
    add_python_only(command, {"--lidar-calibration"}, "lidar scans are read");
    group(command, "Depth by a plane, a network, lidar or stereo",
          {"--camera-height", "--horizon", "--far", "--plane-hfov", "--plane-roll",
           "--stereo-calibration", "--stereo-baseline", "--stereo-focal", "--stereo-doffs",
           "--completion-confidence"});
}

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
    // main() has put what the file says among the arguments by now.
    command
        .add_option("--config",
                    "Take arguments from a YAML file, by their names without dashes (reference,"
                    " source, depth, ...); those given here go before.")
        ->type_name("FILE");
    command.add_flag("--dry-run", arguments.dry_run,
                     "Print what would be read, paired and written, and do no more.");
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

#include "registration.hpp"

#include <charconv>

#include "encoder.hpp"
#include "open_frames.hpp"
#include "xcalib/footage/fingerprint.hpp"
#include "xcalib/stream/files.hpp"

namespace xcalib::cli {
namespace {

std::string text_of(bool value) { return value ? "yes" : "no"; }

// The shortest decimal that reads back as the number.
std::string text_of(double value) {
    char digits[40];
    return {digits, std::to_chars(digits, digits + sizeof digits, value).ptr};
}

std::string text_of(const std::optional<double>& value, const char* none) {
    return value ? text_of(*value) : none;
}

std::string texts_of(const std::vector<double>& values) {
    std::string text;
    for (const double value : values) text += (text.empty() ? "" : ",") + text_of(value);
    return text;
}

std::string text_of(const TimeOffset& offset) {
    if (offset.automatic) return "auto";
    return offset.frames ? std::to_string(offset.frames) + "f" : text_of(offset.seconds);
}

std::string table_text(const std::string& file) {
    if (file.empty()) return "none";
    return absolute_path(file).string() + " (" + fingerprint(read_file(file)) + ")";
}

// A folder by its path from the root, with what is said before it.
std::string depth_text(const std::string& spec) {
    if (spec == "plane") return spec;
    const std::size_t at = spec.rfind("disparity:", 0) == 0 ? spec.find(':') + 1 : 0;
    return spec.substr(0, at) + absolute_path(spec.substr(at)).string();
}

// What the frames are opened with.
MadeWith inputs_of(const FrameArguments& frames) {
    const DepthArguments& depth = frames.depth;
    return {{"reference", absolute_path(frames.reference).string()},
            {"source", absolute_path(frames.source).string()},
            {"depth", depth_text(depth.spec)},
            {"depth_scale", text_of(depth.units.scale, "by type")},
            {"depth_invalid", texts_of(depth.units.invalid)},
            {"stereo_calibration", table_text(depth.stereo_calibration)},
            {"stereo_baseline", text_of(depth.units.baseline)},
            {"stereo_focal", text_of(depth.units.focal)},
            {"stereo_doffs", text_of(depth.units.doffs)},
            {"camera_height", text_of(depth.plane.camera_height)},
            {"horizon", text_of(depth.plane.horizon)},
            {"far", text_of(depth.plane.far)},
            {"plane_hfov", text_of(depth.plane.hfov_deg)},
            {"plane_roll", text_of(depth.plane.roll_deg)},
            {"depth_steady", text_of(depth.steady)},
            {"complete", text_of(depth.complete)},
            {"completion_confidence", text_of(depth.completion_confidence)},
            {"pair", frames.pairing},
            {"time_offset", text_of(frames.time_offset)},
            {"max_gap", text_of(frames.max_gap, "none")},
            {"reference_times", table_text(frames.reference_times)},
            {"source_times", table_text(frames.source_times)},
            {"exif_orientation", frames.exif_orientation},
            {"source_readout", frames.source_readout},
            {"reference_readout", frames.reference_readout}};
}

}  // namespace

Registration register_files(const RegisterArguments& arguments, const Frames& frames,
                            const Rig& rig, Console& console) {
    FfmpegCodecs codecs;
    return register_frames(
        frames, rig, arguments.output, arguments.options, "xcalib-cli", inputs_of(arguments.frames),
        given_files(arguments.frames, arguments.rig), codecs, [&](const Registration& now) {
            console.show("registering", static_cast<double>(now.earlier + now.made) / now.frames,
                         now.line());
        });
}

}  // namespace xcalib::cli

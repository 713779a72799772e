#include <CLI/CLI.hpp>
#include <algorithm>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "open_frames.hpp"
#include "registration.hpp"
#include "xcalib/option_words.hpp"
#include "xcalib/stream/outputs.hpp"

namespace xcalib::cli {
namespace {

void run(RegisterArguments a, Console& console) {
    a.options.registrar.occlusion = value_of<Occlusion>("--occlusion", a.occlusion);
    const Readout readout = readout_of(a.frames);
    const Rig rig = load_rig(a.rig, console);
    Registration totals;
    DepthPointer depth;  // of files
    check_output_writable(a.output);
    if (a.live) {
        if (readout.any())
            throw InputError(
                "--source-readout and --reference-readout need the frame after each, which --live "
                "does not wait for; expected neither");
        // What a camera shows is not to be had again: there is nothing to go on with.
        std::error_code none;
        const auto noted = std::filesystem::file_size(journal_of(a.output), none);
        if (!a.options.overwrite && !none && noted > 0)
            throw InputError(a.output +
                             " holds another run's frames, expected another output, or"
                             " --overwrite; `xcalib-cli join` makes a video of what a killed one"
                             " has left");
        check_alone(a.output);
        check_apart({a.rig, a.frames.reference, a.frames.source},
                    {output_files(a.output, {}, a.options.overlays), {}});
        if (!a.options.overwrite)
            check_not_others(a.output,
                             output_files(a.output, {{"", six_digits(0)}}, a.options.overlays));
        totals = register_live(a, rig, console);
    } else {
        if (a.depth_fd >= 0) throw InputError("--depth-fd goes with --live");
        const Frames frames = with_straight_rows(open_frames(a.frames, rig, console), readout, rig,
                                                 a.options.registrar.nearest);
        if (a.frames.dry_run) return say_plan(frames, {a.output}, {}, console);
        totals = register_files(a, frames, rig, console);
        depth = frames.depth;
    }
    const double share = totals.pixels ? static_cast<double>(totals.valid) / totals.pixels : 0.0;
    console.line(totals.summary() + (a.live ? " live: " : ": ") + a.output);
    if (depth) say_depth(*depth, console);
    console.result({{"frames", totals.frames},
                    {"earlier", totals.earlier},
                    {"valid_share", share},
                    {"not_finite_source_pixels", totals.not_finite},
                    {"frames_per_second", totals.made ? Json(totals.speed()) : Json(nullptr)},
                    {"output", a.output}});
    if (totals.valid == 0) throw NotTrusted("no pixel of " + a.output + " is valid; see its masks");
    require_trusted(rig, a.rig);
}

}  // namespace

void add_register(CLI::App& app, Console& console) {
    CLI::App* command =
        app.add_subcommand("register", "Bring SOURCE images onto the REFERENCE pixels.");
    command->footer(
        "Images keep the source's type. Masks: 0 valid, 1 outside the source, 2 occluded, 3 no"
        " depth.\nInterrupted, the same command goes on where it ended: what is whole is not made"
        " again.\nWith --live REFERENCE and SOURCE are cameras: an index of V4L2 (0 is"
        " /dev/video0), or any source\nthat OpenCV opens: a device, a URL, a GStreamer pipeline.");
    auto arguments = std::make_shared<RegisterArguments>();
    RegisterArguments& a = *arguments;
    command->add_option("RIG", a.rig)->required()->check(kNamed);
    add_frames(*command, a.frames);
    command
        ->add_option("-o,--output", a.output,
                     "Folder to write to: images under the reference's names, and masks/. Or a"
                     " video: .mp4, .avi (8 bit), .mkv (without loss, gray also 16 bit), and its"
                     " masks.")
        ->type_name("OUT")
        ->required();
    command->add_flag("--overlay", a.options.overlays, "Also write red-cyan overlays/.");
    add_python_only(*command, {"--workers", "--scheduler"}, "several workers are used");
    command->add_flag("--overwrite", a.options.overwrite,
                      "Start again from the first frame.  [default: go on where an interrupted run "
                      "of the same command"
                      " ended]");
    command->add_flag("--nearest", a.options.registrar.nearest,
                      "Take the nearest source pixel as it is: radiometric counts are never mixed."
                      "  [default: bilinear]");
    command
        ->add_option("--occlusion", a.occlusion,
                     "What the source sees something nearer in front of: marked in the mask (mark),"
                     " or black as well (hide).")
        ->type_name("HOW")
        ->check(CLI::IsMember(names_of(words<Occlusion>())))
        ->capture_default_str();
    add_threads(*command, a.options.registrar.num_threads);
    CLI::Option* live = command->add_flag("--live", a.live, "REFERENCE and SOURCE are cameras.");
    command
        ->add_option("--depth-fd", a.depth_fd,
                     "Live: read depth maps from this file descriptor (docs/cli.md has the"
                     " format).")
        ->type_name("N")
        ->check(CLI::NonNegativeNumber);
    command
        ->add_option("--depth-sync", a.depth_sync,
                     "Live: register with the latest depth map, or wait for one for each frame.")
        ->type_name("HOW")
        ->check(CLI::IsMember({"latest", "each"}))
        ->needs(live)
        ->capture_default_str();
    command->add_option("--frames", a.max_frames, "Live: stop after so many.  [default: never]")
        ->type_name("N")
        ->check(CLI::PositiveNumber)
        ->needs(live);
    command->add_option("--rate", a.rate, "Live: frames a second of a video that is written.")
        ->type_name("HZ")
        ->check(CLI::PositiveNumber)
        ->needs(live)
        ->capture_default_str();
    command->add_flag("--quiet", console.quiet, "No progress.");
    add_rare_depth(*command, a.frames.depth);
    command->fallthrough();
    command->callback([arguments, &console] { run(*arguments, console); });
}

}  // namespace xcalib::cli

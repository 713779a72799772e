#include <CLI/CLI.hpp>
#include <cmath>
#include <iomanip>
#include <nlohmann/json.hpp>
#include <regex>

#include "commands.hpp"
#include "depth.hpp"
#include "files.hpp"
#include "motion.hpp"
#include "open_frames.hpp"
#include "xcalib/calibrate.hpp"
#include "xcalib/depth/fit_plane.hpp"
#include "xcalib/draw_frames.hpp"
#include "xcalib/footage/choose.hpp"
#include "xcalib/footage/joined.hpp"
#include "xcalib/judge/documents.hpp"
#include "xcalib/option_words.hpp"
#include "xcalib/rig_file.hpp"
#include "xcalib/stream/files.hpp"
#include "xcalib/stream/neighbours.hpp"
#include "xcalib/stream/outputs.hpp"

namespace xcalib::cli {
namespace {

struct CalibrateArguments {
    FrameArguments frames;
    std::string output, choose = "informed", colormap = "auto", initial, search = "auto",
                        mount = "auto", flow = "auto", solver = "ceres", tolerance = "2,5", report,
                        reference_lens = "auto", source_lens = "auto";
    std::optional<std::string> reference_intrinsics, source_intrinsics;
    bool explain = false, refine_plane = false;
    CalibrationOptions options;
};

// FX,FY,CX,CY [px], for images of a size that is not known yet.
Pinhole intrinsics(const std::string& flag, const std::string& text) {
    const auto bad = [&](const std::string& why) {
        return InputError("Invalid value for '" + flag + "': '" + text + "'" + why);
    };
    std::vector<double> numbers;
    std::istringstream parts(text + ",");
    for (std::string part; std::getline(parts, part, ',');) {
        std::size_t used = 0;
        try {
            numbers.push_back(std::stod(part, &used));
        } catch (const std::exception&) {
        }
        if (part.empty() || used != part.size()) throw bad(" is not four numbers FX,FY,CX,CY");
    }
    if (numbers.size() != 4) throw bad(" is not four numbers FX,FY,CX,CY");
    bool good = numbers[0] > 0 && numbers[1] > 0;
    for (const double value : numbers) good = good && std::isfinite(value);
    if (!good) throw bad(": expected finite numbers, FX and FY above 0 px");
    return {1, 1, numbers[0], numbers[1], numbers[2], numbers[3]};
}

// The frames that say most about the rig.
std::vector<int> choose_by_content(const Frames& frames, const CalibrateArguments& arguments,
                                   Console& console, RunFacts& run) {
    const std::vector<int> drawn =
        frames_to_look_at(frames.size(), arguments.options.max_frames, arguments.options.seed);
    // Depth counts where it is cheap.
    const bool with_depth = !arguments.frames.depth.complete && !arguments.frames.depth.steady;
    std::vector<Candidate> candidates;
    for (const int index : drawn) {
        try {
            const Picture reference = (*frames.references)[index];
            const Picture source = (*frames.sources)[index];
            const Picture depth = with_depth ? (*frames.depth)(index, reference) : Picture{};
            candidates.push_back(
                look_at(index, reference.view, source.view, with_depth ? &depth.view : nullptr));
        } catch (const DecodeError& error) {
            Candidate candidate;
            candidate.index = index;
            candidate.decoded = false;
            candidate.reason = error.what();
            candidates.push_back(candidate);
        }
        console.progress(
            "choosing", static_cast<double>(candidates.size()) / static_cast<double>(drawn.size()));
    }
    const Choice choice = choose(std::move(candidates), arguments.options.max_frames);
    if (arguments.explain)
        console.line(choice.table([&](int index) { return frames.references->name(index); }));
    for (const Candidate& c : choice.candidates) {
        run.choice.push_back({frames.references->where(c.index), c.taken, c.reason});
        console.event("candidate", {{"frame", frames.references->where(c.index)},
                                    {"taken", c.taken},
                                    {"agreement", number(c.agreement)},
                                    {"gain", number(c.gain)},
                                    {"reason", c.reason}});
    }
    const std::vector<Candidate> unusable = choice.unusable();
    if (!unusable.empty()) {
        const Candidate& first = unusable[0];
        // What cannot be decoded names its file.
        const std::string why =
            (first.decoded ? frames.references->where(first.index) + ": " : "") + first.reason;
        if (choice.indices.empty())
            throw InputError("none of " + std::to_string(choice.candidates.size()) +
                             " frames can be used; " + why);
        console.warn(left_out(unusable.size(), why));
    }
    return choice.indices;
}

LoadedFrames load(const Frames& frames, const std::vector<int>& chosen, Console& console) {
    LoadedFrames loaded = load_frames(frames, chosen, [&](int done) {
        console.progress("loading", static_cast<double>(done) / static_cast<double>(chosen.size()));
    });
    if (loaded.failures) console.warn(left_out(loaded.failures, loaded.first_failure));
    return loaded;
}

CalibrationResult calibrated(const Frames& frames, const LoadedFrames& loaded,
                             const CalibrationOptions& options, std::optional<Rig> initial,
                             Console& console) {
    const ImageView &reference = loaded.frames[0].reference.view,
                    &source = loaded.frames[0].source.view;
    if (initial)
        initial = fitted(*initial, reference.width, reference.height, source.width, source.height);
    try {
        return calibrate(
            loaded.views(&Frame::reference), loaded.views(&Frame::source),
            loaded.views(&Frame::depth), initial, options,
            [&](const std::string& stage, double share) { console.progress(stage, share); });
    } catch (const std::invalid_argument& error) {
        throw InputError(with_file_name(error.what(), *frames.references, loaded.indices));
    }
}

// Fits at the lags around, for footage that is a sequence. A lag that fits better is taken up where
// it is to be found (`--time-offset auto`): `frames`, `loaded` and `result` are then those of it.
// Otherwise the result is not to be trusted.
void look_at_lags(Frames& frames, LoadedFrames& loaded, const CalibrationOptions& options,
                  const std::optional<Rig>& initial, Console& console, CalibrationResult& result,
                  RunFacts& run) {
    constexpr int kLagRounds = 2;  // times at most that a lag is taken up
    for (int round = 0;; ++round) {
        FittedFrames fitted{loaded.views(&Frame::reference),
                            loaded.views(&Frame::source),
                            loaded.views(&Frame::depth),
                            {}};
        for (const int index : loaded.indices)
            fitted.partners.push_back(frames.partners[static_cast<std::size_t>(index)]);
        const LagReport lag =
            fit_lags(fitted, *frames.all_sources, result.rig, options,
                     [&](double share) { console.progress("lags", 0.9 * share); });
        if (lag.frames == 0 || !frames.offset.automatic || round == kLagRounds) {
            add_lags(lag, frames.offset, *frames.all_sources, result);
            return;
        }
        console.note("clock offset: " + lag.line() + ", taken up");
        std::vector<int> chosen = loaded.indices;
        frames = with_lag(frames, lag.frames, chosen);
        run.lag += lag.frames;
        loaded = load(frames, chosen, console);
        result = calibrated(frames, loaded, options, initial, console);
    }
}

// The readout that is `auto`, as frames of which `loaded` are some show it; `raw` are as they were
// read.
void find_readout(const CalibrateArguments& a, const Frames& raw, const LoadedFrames& loaded,
                  const Rig& rig, Console& console, Readout& readout, RunFacts& run) {
    const bool of_reference = a.frames.reference_readout == "auto";
    FittedFrames fitted{loaded.views(&Frame::reference), {}, loaded.views(&Frame::depth), {}};
    for (const int index : loaded.indices)
        fitted.partners.push_back(raw.partners[static_cast<std::size_t>(index)]);
    const ReadoutFit fit =
        fit_readout(fitted, raw.all_sources, rig, a.options, readout, of_reference, motion_between,
                    [&](double share) { console.progress("readout", share); });
    const std::string camera = of_reference ? "reference" : "source";
    console.line("rolling shutter: " + fit.line(camera));
    console.event("readout", {{"camera", camera}, {"share", fit.share}, {"seen", fit.seen}});
    if (!fit.seen) return;
    (of_reference ? readout.reference : readout.source) = fit.taken();
    run.arguments.insert(run.arguments.end(),
                         {"--" + camera + "-readout", std::to_string(fit.taken()).substr(0, 4)});
}

void check(const CalibrateArguments& a) {
    if (Path(a.report).extension() == ".html")
        throw InputError("--report " + a.report +
                         ": pages are written by the Python command, `xcalib`; expected a file of "
                         "another name, for JSON");
    if (a.reference_intrinsics && (a.options.reference_hfov_deg || a.options.optimize_reference))
        throw InputError(
            "--reference-intrinsics are kept; expected no --reference-hfov or --optimize-reference"
            " with them");
    if (a.explain && a.choose != "informed")
        throw InputError("--explain goes with --choose informed, expected that too");
    if (a.refine_plane && a.frames.depth.spec != "plane")
        throw InputError("--refine-plane goes with --depth plane, not " + a.frames.depth.spec);
    for (const auto& [asked, flag] : {std::pair(a.frames.depth.complete, "--complete"),
                                      std::pair(a.frames.depth.steady, "--depth-steady")})
        if (a.refine_plane && asked)
            throw InputError("--refine-plane fits the plane itself, which " + std::string(flag) +
                             " would change; expected only one of them");
    const bool is_network = a.flow.size() > 5 && a.flow.substr(a.flow.size() - 5) == ".onnx";
    if (is_network)
        throw InputError("--flow " + a.flow +
                         ": networks are run by the Python command, `xcalib`; expected auto, off or"
                         " patch");
    value_of("--flow", a.flow, flow_arguments());
}

void run(CalibrateArguments a, bool has_report, Console& console) {
    check(a);
    CalibrationOptions& options = a.options;
    options.search.mode = value_of<SearchMode>("--search", a.search);
    options.mount = Mount::parse("--mount", a.mount);
    options.tolerance = Tolerance::parse("--tolerance", a.tolerance);
    options.reference_lens = Lens::parse("--reference-lens", a.reference_lens);
    options.source_lens = Lens::parse("--source-lens", a.source_lens);
    options.flow = value_of("--flow", a.flow, flow_arguments());
    options.solver = value_of<Solver>("--solver", a.solver);
    std::optional<Pinhole> reference_camera, source_camera;
    if (a.reference_intrinsics)
        reference_camera = intrinsics("--reference-intrinsics", *a.reference_intrinsics);
    if (a.source_intrinsics)
        source_camera = intrinsics("--source-intrinsics", *a.source_intrinsics);
    options.validate();

    std::optional<Rig> initial;
    if (!a.initial.empty()) initial = load_rig(a.initial, console);
    Readout readout = readout_of(a.frames, true);
    Frames frames = open_frames(a.frames, initial, console);
    std::vector<Path> writes = {a.output};
    if (has_report) writes.emplace_back(a.report);
    check_writes(writes, frames, given_files(a.frames, a.initial));
    const Frames raw = with_scalar_sources(std::move(frames), a.colormap, console);
    frames = with_straight_rows(raw, readout, initial);

    RunFacts run{"xcalib-cli", console.arguments, std::filesystem::current_path().string(), 0, {}};
    const std::vector<int> chosen =
        a.choose == "informed" ? choose_by_content(frames, a, console, run)
                               : draw_frames(frames.size(), options.max_frames, options.seed);
    if (a.frames.dry_run) return say_plan(frames, {a.output, a.report}, chosen, console);
    LoadedFrames loaded = load(frames, chosen, console);
    const auto sized = [](Pinhole camera, const Picture& image) {
        camera.width = image.view.width;
        camera.height = image.view.height;
        return camera;
    };
    if (reference_camera)
        options.reference_camera = sized(*reference_camera, loaded.frames[0].reference);
    if (source_camera) options.source_camera = sized(*source_camera, loaded.frames[0].source);

    CalibrationResult result = calibrated(frames, loaded, options, initial, console);
    const bool finds_readout =
        a.frames.source_readout == "auto" || a.frames.reference_readout == "auto";
    if (finds_readout) find_readout(a, raw, loaded, result.rig, console, readout, run);
    // Which rows of both look the same way is known now.
    if (readout.any() && (finds_readout || (readout.reference != 0 && !initial))) {
        frames = with_straight_rows(raw, readout, result.rig);
        loaded = load(frames, loaded.indices, console);
        result = calibrated(frames, loaded, options, initial, console);
    }
    if (a.refine_plane) {
        std::vector<ImageView> references, sources;
        for (const int i : frames_to_judge_plane(static_cast<int>(loaded.frames.size()))) {
            const Frame& frame = loaded.frames[static_cast<std::size_t>(i)];
            references.push_back(frame.reference.view);
            sources.push_back(frame.source.view);
        }
        int fits = 0;
        const PlaneDepth plane =
            fit_plane(references, sources, a.frames.depth.plane, result.rig, options,
                      [&] { console.progress("plane", std::min(0.99, ++fits / 18.0)); });
        const DepthPointer depth = plane_depth(plane);
        for (std::size_t i = 0; i < loaded.frames.size(); ++i)
            loaded.frames[i].depth = (*depth)(loaded.indices[i], loaded.frames[i].reference);
        frames.depth = depth;
        result = calibrated(frames, loaded, options, result.rig, console);
        for (const auto& [option, value] :
             {std::pair("--horizon", plane.horizon), std::pair("--plane-roll", plane.roll_deg)}) {
            std::ostringstream number;
            number << std::setprecision(17) << value;
            run.arguments.insert(run.arguments.end(), {option, number.str()});
        }
        std::ostringstream text;
        text << "plane: --horizon " << plane.horizon << " --plane-roll " << plane.roll_deg;
        console.line(text.str());
        console.event("plane", {{"horizon", plane.horizon}, {"plane_roll", plane.roll_deg}});
    }
    for (const auto& [side, name] :
         {std::pair(&Frame::reference, "REFERENCE"), std::pair(&Frame::source, "SOURCE")}) {
        const auto [reason, advice] = joined_images(loaded.views(side), name);
        result.distrust(reason, advice);
    }
    look_at_lags(frames, loaded, options, initial, console, result, run);
    const Path output(a.output);
    if (output.has_parent_path()) std::filesystem::create_directories(output.parent_path());
    save_rig(result.rig, a.output);
    console.line(result.report.brief());
    console.line("rig: " + a.output);
    std::vector<std::string> files;
    for (const int index : loaded.indices) files.push_back(frames.references->where(index));
    const std::string document = report_document(result.report, a.output, files, run);
    if (has_report) {
        write_file(a.report, document);
        console.line("report: " + a.report);
    }
    say_depth(*frames.depth, console);
    console.result(Json::parse(document));
    if (!result.converged) throw NotTrusted(result.report.message);
}

void add_lens(CLI::App& command, const std::string& camera, std::string& word) {
    command
        .add_option("--" + camera + "-lens", word,
                    "Known lens of the " + camera +
                        " camera, OpenCV's model and coefficients, kept; auto: that of the initial"
                        " rig, with --" +
                        camera + "-intrinsics none; else " +
                        (camera == "source" ? "k1 and k2 are estimated." : "none."))
        ->type_name("auto|none|brown:K1,K2,P1,P2[,K3[,K4,K5,K6]]|fisheye:K1,K2,K3,K4")
        ->capture_default_str();
}

}  // namespace

void add_calibrate(CLI::App& app, Console& console) {
    CLI::App* command = app.add_subcommand(
        "calibrate", "Estimate both cameras and their pose, and write a rig file.");
    command->footer("The rig is written even if it is not to be trusted (exit code 3).");
    auto arguments = std::make_shared<CalibrateArguments>();
    CalibrateArguments& a = *arguments;
    add_frames(*command, a.frames);
    command->add_option("-o,--output", a.output, "Rig file to write (YAML).")
        ->type_name("RIG")
        ->required();
    command->add_option("--frames", a.options.max_frames, "Frames to use at most.")
        ->type_name("N")
        ->check(CLI::Range(1, 2147483647))
        ->capture_default_str();
    command->add_option("--seed", a.options.seed, "Seed of the frame choice.")
        ->type_name("N")
        ->capture_default_str();
    command
        ->add_option("--choose", a.choose,
                     "Frames by what they say about the rig (informed; looks at 4 N), or spread"
                     " over the footage (spread).")
        ->type_name("HOW")
        ->check(CLI::IsMember({"informed", "spread"}))
        ->capture_default_str();
    command->add_flag("--explain", a.explain,
                      "Print why each frame was taken or left (--choose informed).");
    add_colormap(*command, a.colormap);
    add_threads(*command, a.options.num_threads);
    command
        ->add_option("--initial", a.initial, "Rig file to start from.  [default: none, searched]")
        ->type_name("RIG")
        ->check(kNamed);
    command
        ->add_option("--search", a.search,
                     "Global search before refinement: full, local (around the initial rig), off,"
                     " or auto.")
        ->type_name("HOW")
        ->check(CLI::IsMember(names_of(words<SearchMode>())))
        ->capture_default_str();
    command
        ->add_option(
            "--mount", a.mount,
            "How the source image is turned, in degrees clockwise (90, 180, 270, ...), and"
            " whether it is then mirrored; auto: upright, and where that is not found any.")
        ->type_name("auto|upright|DEG|mirrored[-DEG]")
        ->capture_default_str();
    command
        ->add_option("--max-roll", a.options.search.max_roll_deg,
                     "Roll about the mount that is searched.")
        ->type_name("DEG")
        ->capture_default_str();
    command
        ->add_option("--max-fov-ratio", a.options.search.max_fov_ratio,
                     "Largest ratio of the two fields of view that is searched, either way, in"
                     " tangents.")
        ->type_name("R")
        ->capture_default_str();
    command
        ->add_option("--flow", a.flow,
                     "The flow term: patch, built in; off; auto is patch where nothing is"
                     " searched.")
        ->type_name("auto|off|patch")
        ->capture_default_str();
    command
        ->add_option("--solver", a.solver, "ceres, or adam: the paper's, which searches nothing.")
        ->type_name("NAME")
        ->check(CLI::IsMember(names_of(words<Solver>())))
        ->capture_default_str();
    command
        ->add_option("--reference-intrinsics", a.reference_intrinsics,
                     "Known intrinsics of the reference camera, kept [px].  [default: none]")
        ->type_name("FX,FY,CX,CY");
    command
        ->add_option("--source-intrinsics", a.source_intrinsics,
                     "Known intrinsics of the source camera, kept [px].  [default: none,"
                     " estimated]")
        ->type_name("FX,FY,CX,CY");
    add_lens(*command, "reference", a.reference_lens);
    add_lens(*command, "source", a.source_lens);
    command
        ->add_option("--reference-hfov", a.options.reference_hfov_deg,
                     "Horizontal field of view of the reference camera at the start [deg]."
                     "  [default: searched]")
        ->type_name("DEG");
    command->add_flag("--optimize-reference", a.options.optimize_reference,
                      "Estimate the reference intrinsics too.  [default: kept]");
    command->add_flag("--optimize-lens", a.options.optimize_lens,
                      "Estimate k1 and k2 of the source's lens, from --source-lens where given, and"
                      " keep them whether or not unseen frames gain; with --solver adam too."
                      "  [default: kept where they gain]");
    command
        ->add_option("--working-width", a.options.working_width,
                     "Reference width that calibration works at [px].")
        ->type_name("PX")
        ->check(CLI::Range(1, 2147483647))
        ->capture_default_str();
    command
        ->add_option("--tolerance", a.tolerance,
                     "Expected error up to which the rig is trusted, over the footage's own depths"
                     " [px of the reference at 640 px of width].")
        ->type_name("MEDIAN[,P95]")
        ->capture_default_str();
    command->add_flag("--refine-plane", a.refine_plane,
                      "With --depth plane: find the horizon and the roll from the footage (some 17"
                      " quick fits), and print them for `register`.");
    CLI::Option* report =
        command->add_option("--report", a.report, "Also write the full report (JSON).")
            ->type_name("FILE");
    command->add_flag("--quiet", console.quiet, "No progress.");
    add_rare_depth(*command, a.frames.depth);
    command->fallthrough();
    command->callback(
        [arguments, report, &console] { run(*arguments, !report->empty(), console); });
}

}  // namespace xcalib::cli

#include <CLI/CLI.hpp>
#include <map>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "footage.hpp"
#include "open_frames.hpp"
#include "xcalib/judge/documents.hpp"
#include "xcalib/stream/files.hpp"
#include "xcalib/stream/outputs.hpp"

namespace xcalib::cli {
namespace {

struct EvaluateArguments {
    std::string rig, json_file, registered, colormap = "auto";
    FrameArguments frames;
    int width = 640, threads = 0;
};

// The images of another method, one for each reference: by name, or as many in order.
StreamPointer given_images(const std::string& spec, const Frames& frames) {
    const StreamPointer given = open_stream(spec);
    std::map<std::string, int> names;
    for (int i = 0; i < given->size(); ++i) names[given->name(i)] = i;
    std::vector<int> found;
    std::string missing;
    for (int i = 0; i < frames.size(); ++i) {
        const auto own = names.find(frames.references->name(i));
        if (own != names.end()) found.push_back(own->second);
        else if (missing.empty()) missing = frames.references->name(i);
    }
    if (missing.empty()) return picked(given, found);
    if (given->size() == frames.size()) return given;
    throw InputError("--registered " + spec + ": " + std::to_string(given->size()) +
                     " images, and none named " + missing + "; expected one for each of the " +
                     std::to_string(frames.size()) + " reference frames, of its name");
}

void run(const EvaluateArguments& a, bool has_json, Console& console) {
    const Readout readout = readout_of(a.frames);
    const Rig rig = load_rig(a.rig, console);
    Frames frames = open_frames(a.frames, rig, console);
    if (has_json) check_writes({a.json_file}, frames, given_files(a.frames, a.rig));
    if (a.frames.dry_run) return say_plan(frames, {a.json_file}, {}, console);
    frames = with_scalar_sources(std::move(frames), a.colormap, console);
    frames = with_straight_rows(std::move(frames), readout, rig);
    const StreamPointer given = a.registered.empty() ? nullptr : given_images(a.registered, frames);
    Evaluator evaluator(rig, a.width, a.threads);
    std::vector<std::string> files;
    for (int index = 0; index < frames.size(); ++index) {
        const Frame frame = frames.read(index);
        const Picture theirs = given ? (*given)[index] : Picture{};
        evaluator.add(frame.reference.view, frame.source.view, frame.depth.view,
                      given ? &theirs.view : nullptr);
        files.push_back(frames.references->where(index));
        console.progress("evaluating", static_cast<double>(index + 1) / frames.size());
    }
    const Evaluation result = evaluator.result(true);
    console.line(result.table());
    if (result.verdict) console.line(result.verdict_line());
    say_depth(*frames.depth, console);
    const std::string document = evaluation_document(result, a.rig, files);
    if (has_json) write_file(a.json_file, document);
    console.result(Json::parse(document));
    if (result.valid_share == 0)
        throw NotTrusted("no pixel is valid in " + std::to_string(frames.size()) +
                         " frames, nothing could be scored");
    if (const std::string line = result.difference(rig, a.rig); !line.empty()) console.warn(line);
    require_trusted(rig, a.rig);
}

}  // namespace

void add_evaluate(CLI::App& app, Console& console) {
    CLI::App* command = app.add_subcommand(
        "evaluate",
        "Score the registered SOURCE against REFERENCE, beside the source that is only resized.");
    auto arguments = std::make_shared<EvaluateArguments>();
    EvaluateArguments& a = *arguments;
    command->add_option("RIG", a.rig)->required()->check(kNamed);
    add_frames(*command, a.frames);
    command
        ->add_option("--width", a.width,
                     "Judge at the reference size divided by the least integer that makes it this"
                     " wide [px].")
        ->type_name("PX")
        ->check(CLI::Range(1, 2147483647))
        ->capture_default_str();
    command
        ->add_option("--registered", a.registered,
                     "Also score these images, the source as another method registers it, over the"
                     " same pixels: named as the reference's, or as many.")
        ->type_name("DIR")
        ->check(kNamed);
    CLI::Option* json =
        command
            ->add_option("--json", a.json_file,
                         "Also write all scores, frame by frame (JSON). On stdout: `xcalib-cli"
                         " --json evaluate`.")
            ->type_name("FILE");
    add_colormap(*command, a.colormap);
    add_threads(*command, a.threads);
    command->add_flag("--quiet", console.quiet, "No progress.");
    add_rare_depth(*command, a.frames.depth);
    command->callback([arguments, json, &console] { run(*arguments, !json->empty(), console); });
}

}  // namespace xcalib::cli

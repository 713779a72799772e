#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "files.hpp"
#include "open_frames.hpp"
#include "xcalib/judge/documents.hpp"
#include "xcalib/stream/outputs.hpp"

namespace xcalib::cli {
namespace {

struct Arguments {
    std::string rig, json_file, colormap = "auto";
    FrameArguments frames;
    int width = 640, threads = 0;
};

void run(const Arguments& a, bool has_json, Console& console) {
    const Rig rig = load_rig(a.rig, console);
    Frames frames = open_frames(a.frames, rig, console);
    if (has_json)
        check_writes({a.json_file}, frames,
                     {a.rig, a.frames.reference_times, a.frames.source_times});
    frames = with_scalar_sources(std::move(frames), a.colormap, console);
    Evaluator evaluator(rig, a.width, a.threads);
    std::vector<std::string> files;
    for (int index = 0; index < frames.size(); ++index) {
        const Frame frame = frames.read(index);
        evaluator.add(frame.reference.view, frame.source.view, frame.depth.view);
        files.push_back(frames.references->where(index));
        console.progress("evaluating", static_cast<double>(index + 1) / frames.size());
    }
    const Evaluation result = evaluator.result();
    console.line(result.table());
    const std::string document = evaluation_document(result, a.rig, files);
    if (has_json) write_file(a.json_file, document);
    console.result(Json::parse(document));
    if (result.valid_share == 0)
        throw NotTrusted("no pixel is valid in " + std::to_string(frames.size()) +
                         " frames, nothing could be scored");
    require_trusted(rig, a.rig);
}

}  // namespace

void add_evaluate(CLI::App& app, Console& console) {
    CLI::App* command = app.add_subcommand(
        "evaluate",
        "Score the registered SOURCE against REFERENCE, beside the source that is only resized.");
    auto arguments = std::make_shared<Arguments>();
    Arguments& a = *arguments;
    command->add_option("RIG", a.rig)->required()->check(kNamed);
    add_frames(*command, a.frames);
    command
        ->add_option("--width", a.width,
                     "Judge at the reference size divided by the least integer that makes it this"
                     " wide [px].")
        ->type_name("PX")
        ->check(CLI::Range(1, 2147483647))
        ->capture_default_str();
    CLI::Option* json =
        command
            ->add_option("--json", a.json_file,
                         "Also write all scores, frame by frame (JSON). On stdout: `xcalib-cli"
                         " --json evaluate`.")
            ->type_name("FILE");
    add_colormap(*command, a.colormap);
    add_threads(*command, a.threads);
    command->add_flag("--quiet", console.quiet, "No progress.");
    command->callback([arguments, json, &console] { run(*arguments, !json->empty(), console); });
}

}  // namespace xcalib::cli

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "files.hpp"
#include "open_frames.hpp"
#include "options.hpp"
#include "xcalib/error.hpp"
#include "xcalib/judge/describe.hpp"
#include "xcalib/judge/documents.hpp"

namespace xcalib::cli {
namespace {

void run(const std::string& file, bool as_json, Console& console) {
    if (has_suffix(file, {".bag", ".mcap", ".db3"}) ||
        std::filesystem::exists(Path(file) / "metadata.yaml"))
        throw InputError(file +
                         ": bags are inspected by the Python command, `xcalib inspect`; expected a"
                         " rig file");
    const Rig rig = load_rig(file, console);
    if (console.json) console.result(Json::parse(rig_document(rig)));
    else console.line(as_json ? rig_document(rig) : facts_text(rig));
}

}  // namespace

void add_inspect(CLI::App& app, Console& console) {
    CLI::App* command =
        app.add_subcommand("inspect", "Print what a rig file says, in units one can picture.");
    auto file = std::make_shared<std::string>();
    auto as_json = std::make_shared<bool>(false);
    command->add_option("RIG", *file)->required()->check(kNamed);
    command->add_flag("--json", *as_json, "Print JSON.");
    command->callback([=, &console] { run(*file, *as_json, console); });
}

}  // namespace xcalib::cli

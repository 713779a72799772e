#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "encoder.hpp"
#include "xcalib/stream/interrupts.hpp"

namespace xcalib::cli {

void add_join(CLI::App& app, Console& console) {
    CLI::App* command = app.add_subcommand(
        "join", "Make a video of the parts that a killed `register --live` has left.");
    auto output = std::make_shared<std::string>();
    command->add_option("OUT", *output, "The video that it was to write.")->required();
    command->callback([output, &console] {
        FfmpegCodecs codecs;
        const int frames = join_parts(*output, codecs, [] { check_interrupts(); });
        console.line(std::to_string(frames) + " frames: " + *output);
        console.result({{"frames", frames}, {"output", *output}});
    });
}

}  // namespace xcalib::cli

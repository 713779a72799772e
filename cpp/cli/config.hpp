// `--config FILE`: the arguments of a command in a YAML file, by the names of the options.
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace xcalib::cli {

// The arguments of a command with those of the file that --config names, which give way to them.
// Throws InputError where a key is unknown, or its value is of another kind.
std::vector<std::string> with_config(const CLI::App& command, std::vector<std::string> arguments);

}  // namespace xcalib::cli

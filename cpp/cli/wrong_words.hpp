// Words of the command line that no command knows, and what was meant.
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace xcalib::cli {

// The first of a command's arguments that looks like an option and is none, of it or of the whole
// program; '' where there is none.
std::string unknown_option(const CLI::App& app, const CLI::App& command,
                           const std::vector<std::string>& arguments);

// A line on such an option, with those that are called alike.
std::string no_such_option(const CLI::App& command, const std::string& option);

// The names of a command's positional arguments: `register RIG REFERENCE SOURCE`.
std::string usage_of(const CLI::App& command);

}  // namespace xcalib::cli

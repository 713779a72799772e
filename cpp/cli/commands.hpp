// The commands: each adds itself to the command line, with what it does.
#pragma once

#include "console.hpp"

namespace CLI {
class App;
}

namespace xcalib::cli {

void add_calibrate(CLI::App& app, Console& console);
void add_register(CLI::App& app, Console& console);
void add_evaluate(CLI::App& app, Console& console);
void add_inspect(CLI::App& app, Console& console);
void add_join(CLI::App& app, Console& console);
void add_bench(CLI::App& app, Console& console);

}  // namespace xcalib::cli

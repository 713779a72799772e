// xcalib-cli: the Python command's work on rigs without Python, on the same core.
#include <fcntl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <iostream>
#include <new>
#include <nlohmann/json.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <system_error>

#include "commands.hpp"
#include "config.hpp"
#include "wrong_words.hpp"
#include "xcalib/error.hpp"
#include "xcalib/stream/files.hpp"
#include "xcalib/stream/interrupts.hpp"

namespace {

using namespace xcalib::cli;

constexpr const char* kAbout =
    "Calibrate a fixed pair of cameras, visible and thermal, and register their frames.\n\n"
    "REFERENCE and SOURCE are folders or patterns of images (8 or 16 bit, any size), TIFF stacks\n"
    "or videos; #left, #right, #top or #bottom behind one takes half of each frame.\n\n"
    "Exit codes: 0 done and trusted, 1 failed, 2 wrong usage or input, 3 done, but the result is\n"
    "not to be trusted.\n";

std::string names_of_commands(const std::vector<const CLI::App*>& commands) {
    std::string text;
    for (const CLI::App* command : commands)
        text += (text.empty()                 ? ""
                 : command == commands.back() ? " or "
                                              : ", ") +
                command->get_name();
    return text;
}

// Without it the message would be that a command is missing.
void check_command(const CLI::App& app, int argc, char** argv) {
    const auto first = std::find_if(argv + 1, argv + argc, [](char* word) { return *word != '-'; });
    if (first == argv + argc) {
        for (char** word = argv + 1; word != argv + argc; ++word)
            if (!app.get_option_no_throw(*word))
                throw xcalib::InputError("No such option '" + std::string(*word) + "'");
        return;
    }
    const auto commands = app.get_subcommands([](const CLI::App*) { return true; });
    if (std::none_of(commands.begin(), commands.end(),
                     [&](const CLI::App* command) { return command->check_name(*first); }))
        throw xcalib::InputError("No such command '" + std::string(*first) + "', expected " +
                                 names_of_commands(commands));
}

int run(int argc, char** argv, Console& console) {
    CLI::App app(kAbout, "xcalib-cli");
    app.option_defaults()->always_capture_default(false);
    app.set_help_flag("-h,--help", "Print this help and exit.");
    app.set_version_flag("--version", std::string("xcalib-cli, version ") + XCALIB_VERSION,
                         "Print the version and exit.");
    app.add_flag("--json", console.json,
                 "Results, progress and warnings as JSON on stdout, an object a line.");
    app.require_subcommand(1);
    add_calibrate(app, console);
    add_register(app, console);
    add_evaluate(app, console);
    add_inspect(app, console);
    add_join(app, console);
    add_bench(app, console);
    for (int i = 1; i < argc; ++i) xcalib::check_name(argv[i]);
    console.arguments.assign(argv + 1, argv + argc);
    check_command(app, argc, argv);
    std::vector<std::string> arguments(argv + 1, argv + argc);
    const auto name = std::find_if(arguments.begin(), arguments.end(),
                                   [](const std::string& word) { return word[0] != '-'; });
    const CLI::App* command = nullptr;
    if (name != arguments.end()) {
        command = app.get_subcommand(*name);
        std::vector<std::string> own(name + 1, arguments.end());
        if (std::any_of(own.begin(), own.end(),
                        [](const std::string& word) { return word.rfind("--config", 0) == 0; }))
            own = with_config(*command, own);
        const std::string unknown = unknown_option(app, *command, own);
        if (!unknown.empty()) throw xcalib::InputError(no_such_option(*command, unknown));
        arguments.erase(name + 1, arguments.end());
        arguments.insert(arguments.end(), own.begin(), own.end());
    }
    const std::string usage = command ? "; expected " + usage_of(*command) : "";
    std::reverse(arguments.begin(), arguments.end());  // as CLI11 wants them
    try {
        app.parse(std::move(arguments));
    } catch (const CLI::Success& wanted) {  // help, version
        return app.exit(wanted);
    } catch (const CLI::ConversionError& error) {
        throw xcalib::InputError(std::string(error.what()) + ", expected a number");
    } catch (const CLI::ExtrasError& error) {
        throw xcalib::InputError(error.what() + usage);
    } catch (const CLI::RequiredError& error) {
        const std::string text = error.what();
        throw xcalib::InputError(text + (text[0] == '-' ? "" : usage));
    } catch (const CLI::ParseError& error) {
        throw xcalib::InputError(error.what());
    }
    return kDone;
}

// A file that is opened must not take the place of a closed stdout, and what is said there.
void keep_standard_streams() {
    while (true) {
        const int file = open("/dev/null", O_RDWR);
        if (file < 0) return;
        if (file > STDERR_FILENO) {
            close(file);
            return;
        }
    }
}

}  // namespace

int main(int argc, char** argv) {
    keep_standard_streams();
    // Libraries' own words on a bad file would come between our one line and its reader.
    setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", 0);
    setenv("OPENCV_IO_ENABLE_OPENEXR", "1", 0);  // OpenCV reads EXR on request only
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    std::cerr.rdbuf(nullptr);
    const xcalib::Interrupts held;
    std::signal(SIGXFSZ, SIG_IGN);  // a limit on the size of files is an error like a full disk
    std::signal(SIGPIPE, SIG_IGN);  // what is under way is brought to its end
    Console console;
    try {
        const int code = run(argc, argv, console);
        console.event("end", {{"exit_code", code}});
        return code;
    } catch (const ClosedPipe&) {
        return kFailed;
    } catch (const NotTrusted& error) {
        console.error(kNotTrusted, error.what());
        return kNotTrusted;
    } catch (const std::system_error& error) {  // files: what() begins with the path
        console.error(kWrongInput, error.what());
        return kWrongInput;
    } catch (const std::invalid_argument& error) {
        console.error(kWrongInput, error.what());
        return kWrongInput;
    } catch (const std::bad_alloc&) {
        console.error(kFailed, "out of memory");
        return kFailed;
    } catch (const std::exception& error) {
        console.error(kFailed, error.what());
        return kFailed;
    }
}

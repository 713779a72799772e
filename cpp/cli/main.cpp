// xcalib-cli: the Python command's work on rigs without Python, on the same core.
#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdlib>
#include <iostream>
#include <new>
#include <nlohmann/json.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <system_error>

#include "commands.hpp"
#include "xcalib/error.hpp"
#include "xcalib/stream/interrupts.hpp"

namespace {

using namespace xcalib::cli;

constexpr const char* kAbout =
    "Calibrate a fixed pair of cameras, visible and thermal, and register their frames.\n\n"
    "REFERENCE and SOURCE are folders or patterns of images (8 or 16 bit, any size), TIFF stacks\n"
    "or videos; #left, #right, #top or #bottom behind one takes half of each frame.\n\n"
    "Exit codes: 0 done and trusted, 1 failed, 2 wrong usage or input, 3 done, but the result is\n"
    "not to be trusted.\n";

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
    add_bench(app, console);
    try {
        app.parse(argc, argv);
    } catch (const CLI::Success& wanted) {  // help, version
        return app.exit(wanted);
    } catch (const CLI::ParseError& error) {
        throw xcalib::InputError(error.what());
    }
    return kDone;
}

}  // namespace

int main(int argc, char** argv) {
    // Libraries' own words on a bad file would come between our one line and its reader.
    setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", 0);
    setenv("OPENCV_IO_ENABLE_OPENEXR", "1", 0);  // OpenCV reads EXR on request only
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    const xcalib::Interrupts held;
    std::signal(SIGXFSZ, SIG_IGN);  // a limit on the size of files is an error like a full disk
    Console console;
    try {
        const int code = run(argc, argv, console);
        console.event("end", {{"exit_code", code}});
        return code;
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

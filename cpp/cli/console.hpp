// What the command says, and where: results on stdout, progress and errors on stderr; with --json
// all of it as JSON on stdout, an object a line.
#pragma once

#include <chrono>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "xcalib/camera.hpp"

namespace xcalib::cli {

using Json = nlohmann::ordered_json;

enum Exit : int { kDone = 0, kFailed = 1, kWrongInput = 2, kNotTrusted = 3 };

// Null in place of what is not finite, which JSON does not know.
Json number(double value);

// Ends the command: done, but the result is not to be trusted.
class NotTrusted : public std::runtime_error {
    using std::runtime_error::runtime_error;
};

// The same, for a rig whose calibration was not.
void require_trusted(const Rig& rig, const std::string& file);

// Whoever read our output has gone: nothing is to be said any more.
class ClosedPipe : public std::runtime_error {
   public:
    ClosedPipe() : std::runtime_error("nobody reads stdout") {}
};

class Console {
   public:
    bool json = false;
    bool quiet = false;                  // no progress
    std::vector<std::string> arguments;  // of the program

    void line(const std::string& text);  // a result, for people; not with --json
    void result(const Json& fields);     // a result, for machines; only with --json
    void event(const std::string& name, Json fields);
    void note(const std::string& text);
    void warn(const std::string& text);
    void error(int code, const std::string& text) noexcept;
    // `fraction` of `stage`, (0, 1]. `detail`: more of it, for people; where there is no terminal,
    // a line now and then.
    void show(const std::string& stage, double fraction, const std::string& detail = "");
    // The same; throws Interrupted where asked to end.
    void progress(const std::string& stage, double fraction);

   private:
    std::mutex mutex_;
    bool bar_ = false;  // stands on stderr
    int percent_ = -1;
    std::string stage_;
    std::chrono::steady_clock::time_point said_ = std::chrono::steady_clock::now();

    void clear_bar();
    void put(const std::string& text);
    void print(const std::string& label, const std::string& text);
};

}  // namespace xcalib::cli

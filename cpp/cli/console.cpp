#include "console.hpp"

#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <iostream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "xcalib/stream/interrupts.hpp"

namespace xcalib::cli {
namespace {

constexpr auto kBetweenLines = std::chrono::seconds(10);

std::string one_line(const std::string& text) {
    std::istringstream words(text);
    std::string line;
    for (std::string word; words >> word;) line += (line.empty() ? "" : " ") + word;
    return line;
}

}  // namespace

void require_trusted(const Rig& rig, const std::string& file) {
    if (rig.verdict && !rig.verdict->trusted) throw NotTrusted(file + ": " + rig.verdict->line());
}

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

void Console::clear_bar() {
    if (bar_) std::cerr << "\r\033[K" << std::flush;
    bar_ = false;
}

void Console::put(const std::string& text) {
    std::cout << text << "\n" << std::flush;
    if (!std::cout) throw std::runtime_error("cannot write to stdout");
}

void Console::line(const std::string& text) {
    const std::lock_guard lock(mutex_);
    clear_bar();
    if (!json) put(text);
}

void Console::result(const Json& fields) { event("result", fields); }

void Console::event(const std::string& name, Json fields) {
    if (!json) return;
    const std::lock_guard lock(mutex_);
    Json object{{"event", name}};
    object.update(fields);
    put(object.dump(-1, ' ', false, Json::error_handler_t::replace));
}

void Console::print(const std::string& label, const std::string& text) {
    const std::lock_guard lock(mutex_);
    clear_bar();
    std::cerr << label << one_line(text) << std::endl;
}

void Console::note(const std::string& text) {
    print("", text);
    event("note", {{"message", one_line(text)}});
}

void Console::warn(const std::string& text) {
    print("warning: ", text);
    event("warning", {{"message", one_line(text)}});
}

void Console::error(int code, const std::string& text) {
    print(code == kNotTrusted ? "not to be trusted: " : "error: ", text);
    event("end", {{"exit_code", code}, {"message", one_line(text)}});
}

void Console::progress(const std::string& stage, double fraction) {
    check_interrupts();
    show(stage, fraction);
}

void Console::show(const std::string& stage, double fraction, const std::string& detail) {
    const int percent = static_cast<int>(100 * fraction);
    const bool terminal = isatty(STDERR_FILENO);
    {
        const std::lock_guard lock(mutex_);
        if (quiet) return;
        const auto now = std::chrono::steady_clock::now();
        if (!json && !terminal && !detail.empty() && now - said_ > kBetweenLines) {
            said_ = now;
            std::cerr << stage << ": " << detail << std::endl;
        }
        if (percent == percent_ && stage == stage_) return;
        percent_ = percent;
        stage_ = stage;
        if (!json && terminal) {
            std::fprintf(stderr, "\r\033[K%s %3d%% %s", stage.c_str(), percent, detail.c_str());
            bar_ = fraction < 1;
            if (!bar_) std::fputs("\r\033[K", stderr);
            std::fflush(stderr);
        }
    }
    event("progress", {{"stage", stage}, {"fraction", fraction}});
}

}  // namespace xcalib::cli

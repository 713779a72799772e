#include "console.hpp"

#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>
#include <system_error>

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

// std::cerr is left to libraries, and leads nowhere: main(). What cannot be said there is not said.
void put_on_stderr(const std::string& text) {
    for (std::size_t done = 0; done < text.size();) {
        const ssize_t written = write(STDERR_FILENO, text.data() + done, text.size() - done);
        if (written < 0 && errno == EINTR) continue;
        if (written <= 0) return;
        done += static_cast<std::size_t>(written);
    }
}

}  // namespace

void require_trusted(const Rig& rig, const std::string& file) {
    if (rig.verdict && !rig.verdict->trusted) throw NotTrusted(file + ": " + rig.verdict->line());
}

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

void Console::clear_bar() {
    if (bar_) put_on_stderr("\r\033[K");
    bar_ = false;
}

void Console::put(const std::string& text) {
    const std::string line = text + "\n";
    for (std::size_t done = 0; done < line.size();) {
        const ssize_t written = write(STDOUT_FILENO, line.data() + done, line.size() - done);
        if (written < 0 && errno == EINTR) continue;
        if (written < 0 && errno == EPIPE) throw ClosedPipe();
        if (written <= 0) throw std::system_error(errno, std::generic_category(), "stdout");
        done += static_cast<std::size_t>(written);
    }
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
    put_on_stderr(label + one_line(text) + "\n");
}

void Console::note(const std::string& text) {
    print("", text);
    event("note", {{"message", one_line(text)}});
}

void Console::warn(const std::string& text) {
    print("warning: ", text);
    event("warning", {{"message", one_line(text)}});
}

void Console::error(int code, const std::string& text) noexcept {
    try {
        print(code == kNotTrusted ? "not to be trusted: " : "error: ", text);
        event("end", {{"exit_code", code}, {"message", one_line(text)}});
    } catch (const std::exception&) {
        // The first of two errors is shown; this one may be that nothing can be.
    }
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
        if (!json && !terminal && now - said_ > kBetweenLines) {
            said_ = now;
            put_on_stderr(stage + ": " +
                          (detail.empty() ? std::to_string(percent) + " %" : detail) + "\n");
        }
        if (percent == percent_ && stage == stage_) return;
        percent_ = percent;
        stage_ = stage;
        if (!json && terminal) {
            put_on_stderr("\r\033[K" + stage + " " + std::to_string(percent) + "% " + detail);
            bar_ = true;
            if (fraction >= 1) clear_bar();
        }
    }
    event("progress", {{"stage", stage}, {"fraction", fraction}});
}

}  // namespace xcalib::cli

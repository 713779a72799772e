#include "journal.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <nlohmann/json.hpp>
#include <sstream>
#include <system_error>

#include "xcalib/error.hpp"

namespace xcalib::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kFormat = "xcalib-register";
constexpr int kVersion = 1;

std::string dumped(const Json& value) {
    return value.dump(-1, ' ', true, Json::error_handler_t::replace);
}

Unit unit_of(const Json& line) {
    Unit unit;
    for (const auto& [key, valid] : line.at("frames").items())
        unit.frames.emplace_back(key, valid.get<long>());
    for (const auto& [name, size] : line.at("files").items()) {
        // What --overwrite removes is ours.
        const Path file(name);
        if (file.is_absolute() || std::find(file.begin(), file.end(), "..") != file.end())
            throw std::invalid_argument(name);
        unit.files.emplace_back(name, size.get<std::uintmax_t>());
    }
    if (unit.frames.empty() || unit.files.empty()) throw std::invalid_argument("empty");
    return unit;
}

// Of values by name: the first that are not the same.
std::string differences(const Json& before, const Json& now) {
    std::string text;
    int count = 0;
    const auto value = [](const Json& values, const std::string& name) {
        if (!values.contains(name)) return std::string("None");
        return values[name].is_string() ? values[name].get<std::string>() : dumped(values[name]);
    };
    const auto compare = [&](const std::string& name) {
        const std::string old_value = value(before, name), new_value = value(now, name);
        if (old_value == new_value || ++count > 3) return;
        text += (text.empty() ? "" : ", ") + name + " " + old_value + ", now " + new_value;
    };
    for (const auto& [name, unused] : before.items()) compare(name);
    for (const auto& [name, unused] : now.items())
        if (!before.contains(name)) compare(name);
    return text;
}

}  // namespace

Journal::Journal(Path path, const MadeWith& made_with, bool overwrite) : path_(std::move(path)) {
    Json values = Json::object();
    for (const auto& [name, value] : made_with) values[name] = value;
    first_ = dumped({{"format", kFormat}, {"version", kVersion}, {"made_with", values}});
    if (!fs::is_regular_file(path_)) return;
    open();
    try {
        load(made_with, overwrite);
    } catch (...) {
        close();
        throw;
    }
}

Journal::~Journal() { close(); }

void Journal::close() {
    if (descriptor_ >= 0) ::close(descriptor_);
    descriptor_ = -1;
}

void Journal::append(std::vector<std::pair<std::string, long>> frames,
                     const std::vector<std::string>& files) {
    Unit unit{std::move(frames), {}};
    Json line{{"frames", Json::object()}, {"files", Json::object()}};
    auto& named = line["frames"].get_ref<Json::object_t&>();
    for (const auto& [key, valid] : unit.frames) named.push_back({key, valid});  // none twice
    for (const std::string& name : files) {
        unit.files.emplace_back(name, fs::file_size(path_.parent_path() / name));
        line["files"][name] = unit.files.back().second;
    }
    const std::lock_guard lock(mutex_);
    if (descriptor_ < 0) {
        if (path_.has_parent_path()) fs::create_directories(path_.parent_path());
        open();
        if (lseek(descriptor_, 0, SEEK_END) > 0) {  // it was not there when this run began
            close();
            throw InputError(path_.string() + ": another run has written to this output");
        }
        write(first_);
    }
    write(dumped(line));
    units_.push_back(std::move(unit));
}

void Journal::open() {
    descriptor_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
    if (descriptor_ < 0) throw std::system_error(errno, std::generic_category(), path_.string());
    if (flock(descriptor_, LOCK_EX | LOCK_NB) != 0) {
        close();
        throw InputError(path_.string() + ": another run is writing to this output");
    }
}

void Journal::write(const std::string& line) {
    const std::string data = line + "\n";
    const off_t start = lseek(descriptor_, 0, SEEK_END);
    const ssize_t written = ::write(descriptor_, data.data(), data.size());
    if (written == static_cast<ssize_t>(data.size())) return;
    const int code = written < 0 ? errno : ENOSPC;
    if (ftruncate(descriptor_, start) != 0) {
        // What is left is half a line, which the next run takes off.
    }
    throw std::system_error(code, std::generic_category(), path_.string());
}

void Journal::load(const MadeWith& made_with, bool overwrite) {
    const std::string data = read_file(path_);
    const std::size_t end = data.rfind('\n');  // a killed run may leave half a line
    const std::string whole = data.substr(0, end == std::string::npos ? 0 : end + 1);
    std::vector<Unit> units;
    Json before;
    try {
        std::istringstream lines(whole);
        for (std::string line; std::getline(lines, line);) {
            const Json parsed = Json::parse(line);
            if (!before.is_null()) {
                units.push_back(unit_of(parsed));
                continue;
            }
            if (parsed.at("format") != kFormat || parsed.at("version") != kVersion)
                throw std::invalid_argument("format");
            before = parsed.at("made_with");
            if (!before.is_object()) throw std::invalid_argument("made_with");
        }
    } catch (const std::exception&) {
        throw InputError(path_.string() + ": not a journal of format " + kFormat + ", version " +
                         std::to_string(kVersion) +
                         "; expected another output, or this file removed");
    }
    if (overwrite) {
        for (const Unit& unit : units)
            for (const auto& [name, size] : unit.files) fs::remove(path_.parent_path() / name);
    } else if (!before.is_null()) {
        Json now = Json::object();
        for (const auto& [name, value] : made_with) now[name] = value;
        const std::string differs = differences(before, now);
        if (!differs.empty())
            throw InputError(path_.string() + ": this output was made otherwise (" + differs +
                             "); expected the same, another output, or --overwrite");
    }
    if (overwrite || before.is_null()) {
        if (ftruncate(descriptor_, 0) != 0)
            throw std::system_error(errno, std::generic_category(), path_.string());
        write(first_);
        return;
    }
    if (whole.size() < data.size() && ftruncate(descriptor_, static_cast<off_t>(whole.size())) != 0)
        throw std::system_error(errno, std::generic_category(), path_.string());
    const auto is_whole = [this](const Unit& unit) {
        return std::all_of(unit.files.begin(), unit.files.end(), [this](const auto& file) {
            std::error_code error;
            return fs::file_size(path_.parent_path() / file.first, error) == file.second && !error;
        });
    };
    std::copy_if(units.begin(), units.end(), std::back_inserter(units_), is_whole);
}

}  // namespace xcalib::cli

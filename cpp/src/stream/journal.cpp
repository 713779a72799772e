#include "xcalib/stream/journal.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <system_error>

#include "base/read_file.hpp"
#include "base/whole_file.hpp"
#include "xcalib/error.hpp"
#include "xcalib/stream/files.hpp"

namespace xcalib {
namespace {

namespace fs = std::filesystem;
using Path = fs::path;
using Json = nlohmann::ordered_json;

constexpr const char* kFormat = "xcalib-register";
constexpr int kVersion = 1;

std::string dumped(const Json& value) {
    return value.dump(-1, ' ', true, Json::error_handler_t::replace);
}

// Of a file beside the journal, or in a folder beside it.
bool is_inside(const Path& name) {
    const auto parts = std::distance(name.begin(), name.end());
    return name.is_relative() && name.has_filename() && parts <= 2 && *name.begin() != "..";
}

// Removes a file that a run has made: not what has been put in its place, nor what lies elsewhere
// and is only linked to here, nor what a run does not write.
void remove_made(const Path& folder, const std::string& name, std::uintmax_t size) {
    static const std::set<std::string> kWritten = {".png", ".tiff", ".mkv", ".mp4", ".avi"};
    const Path file = folder / name;
    struct stat about, holder;
    if (!kWritten.count(lower_suffix(file))) return;
    if (Path(name).has_parent_path() &&
        (lstat(file.parent_path().c_str(), &holder) != 0 || !S_ISDIR(holder.st_mode)))
        return;
    if (lstat(file.c_str(), &about) != 0 || !S_ISREG(about.st_mode)) return;
    if (static_cast<std::uintmax_t>(about.st_size) == size) fs::remove(file);
}

// A video's frames are many: an object that keeps their order would look for each among all those
// before, so both lists are noted as they are read.
Unit unit_of(const std::string& line) {
    using Event = nlohmann::json::parse_event_t;
    Unit unit;
    std::string section, key;
    const auto note = [&](int depth, Event event, const nlohmann::json& value) {
        if (event == Event::key) (depth == 1 ? section : key) = value.get<std::string>();
        if (event != Event::value || depth != 2) return true;
        if (section == "frames") unit.frames.emplace_back(key, value.get<long>());
        if (section == "files") unit.files.emplace_back(key, value.get<std::uintmax_t>());
        return true;
    };
    if (!nlohmann::json::parse(line, note).is_object()) throw std::invalid_argument(line);
    for (const auto& [name, size] : unit.files)
        if (!is_inside(name)) throw std::invalid_argument(name);
    if (unit.frames.empty() || unit.files.empty()) throw std::invalid_argument("empty");
    return unit;
}

// The first values that are not the same, by name; the command alone, if that differs.
std::string differences(const Json& before, const Json& now) {
    std::string text;
    int count = 0;
    const auto value = [](const Json& values, const std::string& name) {
        if (!values.contains(name)) return std::string("none");
        return values[name].is_string() ? values[name].get<std::string>() : dumped(values[name]);
    };
    const auto compare = [&](const std::string& name) {
        const std::string old_value = value(before, name), new_value = value(now, name);
        if (old_value == new_value || ++count > 3) return;
        text += (text.empty() ? "" : ", ") + name + " " + old_value + ", now " + new_value;
    };
    compare("command");
    if (count) return text;
    for (const auto& [name, unused] : before.items()) compare(name);
    for (const auto& [name, unused] : now.items())
        if (!before.contains(name)) compare(name);
    return text;
}

// Whether the open file is what stands at the path now.
bool is_file_at(int descriptor, const Path& path) {
    struct stat ours, there;
    return fstat(descriptor, &ours) == 0 && stat(path.c_str(), &there) == 0 &&
           ours.st_dev == there.st_dev && ours.st_ino == there.st_ino;
}

}  // namespace

Journal::Journal(Path path, const MadeWith& made_with, bool overwrite) : path_(std::move(path)) {
    Json values = Json::object();
    for (const auto& [name, value] : made_with) values[name] = value;
    first_ = dumped({{"format", kFormat}, {"version", kVersion}, {"made_with", values}});
    try {
        open();
        load(&made_with, overwrite);
    } catch (...) {
        close();
        throw;
    }
}

Journal::Journal(Path path) : path_(std::move(path)) {
    if (!fs::exists(path_)) throw InputError(path_.string() + ": no such journal");
    try {
        open();
        load(nullptr, false);
        if (is_new_) throw InputError(path_.string() + ": nothing is noted in it");
    } catch (...) {
        close();
        throw;
    }
}

std::string Journal::made_with(const std::string& name) const {
    for (const auto& [known, value] : made_with_)
        if (known == name) return value;
    return "";
}

Journal::~Journal() { close(); }

void Journal::close() {
    std::error_code ignored;
    if (descriptor_ >= 0) {
        if (lseek(descriptor_, 0, SEEK_END) == 0 && is_file_at(descriptor_, path_))
            fs::remove(path_, ignored);
        ::close(descriptor_);
        descriptor_ = -1;
    }
    for (const Path& folder : made_folders_) ::rmdir(folder.c_str());  // if it is an empty folder
}

void Journal::append(std::vector<std::pair<std::string, long>> frames,
                     const std::vector<std::string>& files) {
    Unit unit{std::move(frames), {}};
    for (const std::string& name : files)
        unit.files.emplace_back(name, fs::file_size(path_.parent_path() / name));
    append(std::vector<Unit>{std::move(unit)});
}

void Journal::claim() {
    const std::lock_guard lock(mutex_);
    if (lseek(descriptor_, 0, SEEK_END) != 0) return;
    write(first_ + "\n");
    sync();
    sync_to_disk(path_.has_parent_path() ? path_.parent_path() : ".");
}

void Journal::sync() const {
    if (fdatasync(descriptor_) != 0 && errno != EINVAL)
        throw std::system_error(errno, std::generic_category(), path_.string());
}

void Journal::append(const std::vector<Unit>& units) {
    std::string lines;
    for (const Unit& unit : units) {
        Json line{{"frames", Json::object()}, {"files", Json::object()}};
        auto& named = line["frames"].get_ref<Json::object_t&>();
        for (const auto& [key, valid] : unit.frames) named.push_back({key, valid});  // none twice
        for (const auto& [name, size] : unit.files) line["files"][name] = size;
        lines += dumped(line) + "\n";
    }
    claim();
    const std::lock_guard lock(mutex_);
    write(lines);
    sync();
}

void Journal::open() {
    for (Path folder = path_.parent_path(); !folder.empty() && !fs::exists(folder);
         folder = folder.parent_path())
        made_folders_.push_back(folder);
    if (path_.has_parent_path()) fs::create_directories(path_.parent_path());
    while (descriptor_ < 0) {
        struct stat about;
        if (lstat(path_.c_str(), &about) == 0 && !S_ISREG(about.st_mode))
            throw InputError(path_.string() + " is no file, expected a journal, or another output");
        const int file = ::open(
            path_.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0666);
        if (file < 0) throw std::system_error(errno, std::generic_category(), path_.string());
        if (flock(file, LOCK_EX | LOCK_NB) != 0) {
            ::close(file);
            throw InputError(path_.string() + ": another run is writing to this output");
        }
        if (is_file_at(file, path_)) descriptor_ = file;
        else ::close(file);  // removed by the run that held it
    }
}

void Journal::write(const std::string& data) {
    const off_t start = lseek(descriptor_, 0, SEEK_END);
    const ssize_t written = ::write(descriptor_, data.data(), data.size());
    if (written == static_cast<ssize_t>(data.size())) return;
    const int code = written < 0 ? errno : ENOSPC;
    if (ftruncate(descriptor_, start) != 0) {
        // What is left is half a line, which the next run takes off.
    }
    throw std::system_error(code, std::generic_category(), path_.string());
}

void Journal::load(const MadeWith* made_with, bool overwrite) {
    const std::string data = read_file(path_, kMaxTableBytes);
    const std::size_t end = data.rfind('\n');  // a killed run may leave half a line
    const std::string whole = data.substr(0, end == std::string::npos ? 0 : end + 1);
    std::vector<Unit> units;
    Json before;
    try {
        std::istringstream lines(whole);
        for (std::string line; std::getline(lines, line);) {
            if (!before.is_null()) {
                units.push_back(unit_of(line));
                continue;
            }
            const Json parsed = Json::parse(line);
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
            for (const auto& [name, size] : unit.files)
                remove_made(path_.parent_path(), name, size);
    } else if (!before.is_null()) {
        for (const auto& [name, value] : before.items())
            if (value.is_string()) made_with_.emplace_back(name, value.get<std::string>());
    }
    if (!overwrite && !before.is_null() && made_with) {
        Json now = Json::object();
        for (const auto& [name, value] : *made_with) now[name] = value;
        const std::string differs = differences(before, now);
        if (!differs.empty())
            throw InputError(path_.string() + ": this output was made otherwise (" + differs +
                             "); expected the same, another output, or --overwrite");
    }
    if (overwrite) {
        if (ftruncate(descriptor_, 0) != 0)
            throw std::system_error(errno, std::generic_category(), path_.string());
        return;
    }
    is_new_ = before.is_null();
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

}  // namespace xcalib

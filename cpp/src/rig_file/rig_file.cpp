#include "xcalib/rig_file.hpp"

#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <iterator>
#include <limits>
#include <locale>
#include <sstream>
#include <stdexcept>
#include <system_error>

namespace xcalib {
namespace {

[[noreturn]] void reject(const std::string& path, const std::string& what) {
    throw std::invalid_argument(path + ": " + what);
}

// The shortest text that reads back as the same double, whatever the locale.
std::string text_of(double value) {
    char buffer[32];
    const auto end = std::to_chars(buffer, buffer + sizeof buffer, value).ptr;
    return std::string(buffer, end);
}

// A mapping of which every key is known, and present but for those that may be left out.
class Section {
   public:
    Section(const std::string& path, std::string name, const YAML::Node& node,
            std::initializer_list<const char*> keys,
            std::initializer_list<const char*> optional = {})
        : path_(path), name_(std::move(name)), node_(node) {
        if (!node.IsMap()) reject(path, "expected a mapping of fields in " + name_);
        for (const auto& item : node) {
            const std::string key = item.first.as<std::string>();
            bool known = false;
            for (const auto& list : {keys, optional})
                for (const char* expected : list) known = known || key == expected;
            if (!known) reject(path, "unknown field '" + key + "' in " + name_);
        }
        for (const char* key : keys)
            if (!node[key]) reject(path, std::string("missing field '") + key + "' in " + name_);
    }

    YAML::Node node(const char* key) const { return node_[key]; }

    std::string text(const char* key) const {
        if (!node_[key].IsScalar()) fail(key, "(not a single value)", "text");
        return node_[key].Scalar();
    }

    int size(const char* key) const { return whole(key, "a whole number of px, at least 1"); }
    int count(const char* key) const { return whole(key, "a whole number, at least 1"); }

    double number(const char* key) const { return number(key, node_[key]); }

    // A depth [m], .inf for what is far.
    double depth(const char* key) const {
        const double value = length(key, node_[key]);
        if (!(value > 0)) fail(key, scalar(node_[key]), "a depth > 0 or .inf");
        return value;
    }

    bool flag(const char* key) const {
        const std::string word = text(key);
        if (word != "true" && word != "false") fail(key, word, "true or false");
        return word == "true";
    }

    std::vector<double> numbers(const char* key, std::size_t count) const {
        const YAML::Node list = node_[key];
        if (!list.IsSequence() || list.size() != count)
            fail(key, list.IsSequence() ? std::to_string(list.size()) + " values" : scalar(list),
                 "a list of " + std::to_string(count) + " numbers");
        std::vector<double> out;
        for (const YAML::Node& item : list) out.push_back(number(key, item));
        return out;
    }

    [[noreturn]] void fail(const char* key, const std::string& value,
                           const std::string& expected) const {
        reject(path_, name_ + "." + key + " = " + value + ", expected " + expected);
    }

    // Lengths, each of which may be .inf.
    std::vector<double> lengths(const char* key, std::size_t count) const {
        const YAML::Node list = node_[key];
        if (!list.IsSequence() || list.size() != count)
            fail(key, scalar(list), "a list of " + std::to_string(count) + " lengths");
        std::vector<double> out;
        for (const YAML::Node& item : list) out.push_back(length(key, item));
        return out;
    }

   private:
    double length(const char* key, const YAML::Node& node) const {
        const bool infinite = node.IsScalar() && node.Scalar() == ".inf";
        const double value = infinite ? std::numeric_limits<double>::infinity() : number(key, node);
        if (!(value >= 0)) fail(key, scalar(node), "a length >= 0 or .inf");
        return value;
    }
    int whole(const char* key, const char* expected) const {
        int value = 0;
        const std::string text = node_[key].IsScalar() ? node_[key].Scalar() : "";
        const char* const end = text.data() + text.size();
        if (std::from_chars(text.data(), end, value).ptr != end || value < 1)
            fail(key, scalar(node_[key]), expected);
        return value;
    }
    static std::string scalar(const YAML::Node& node) {
        return node.IsScalar() ? node.Scalar() : "(not a single value)";
    }
    double number(const char* key, const YAML::Node& node) const {
        double value = 0;
        const std::string text = node.IsScalar() ? node.Scalar() : "";
        const char* const end = text.data() + text.size();
        if (std::from_chars(text.data(), end, value).ptr != end || text.empty() ||
            !std::isfinite(value))
            fail(key, scalar(node), "a finite number");
        return value;
    }

    const std::string& path_;
    std::string name_;
    YAML::Node node_;
};

Pinhole read_camera(const std::string& path, const char* name, const YAML::Node& node) {
    const Section section(path, name, node, {"width", "height", "fx", "fy", "cx", "cy", "skew"});
    Pinhole camera;
    camera.width = section.size("width");
    camera.height = section.size("height");
    camera.fx = section.number("fx");
    camera.fy = section.number("fy");
    camera.cx = section.number("cx");
    camera.cy = section.number("cy");
    camera.skew = section.number("skew");
    return camera;
}

void write_camera(std::ostream& out, const char* name, const Pinhole& camera) {
    out << name << ":\n"
        << "  width: " << camera.width << "\n"
        << "  height: " << camera.height << "\n"
        << "  fx: " << text_of(camera.fx) << "\n"
        << "  fy: " << text_of(camera.fy) << "\n"
        << "  cx: " << text_of(camera.cx) << "\n"
        << "  cy: " << text_of(camera.cy) << "\n"
        << "  skew: " << text_of(camera.skew) << "\n";
}

// [median, 95 %]; either may be .inf.
ExpectedError read_error(const Section& section, const char* key) {
    const std::vector<double> values = section.lengths(key, 2);
    return {values[0], values[1]};
}

Verdict read_verdict(const std::string& path, const YAML::Node& node) {
    const Section section(
        path, "calibration", node,
        {"trusted", "found", "reason", "expected_error_px", "frames", "date", "software"},
        {"advice", "error_by_depth"});
    Verdict verdict;
    verdict.trusted = section.flag("trusted");
    verdict.found = section.flag("found");
    verdict.reason = section.text("reason");
    if (section.node("advice")) verdict.advice = section.text("advice");
    verdict.expected_error = read_error(section, "expected_error_px");
    verdict.frames = section.count("frames");
    verdict.date = section.text("date");
    verdict.software = section.text("software");
    if (const YAML::Node table = section.node("error_by_depth")) {
        if (!table.IsSequence())
            section.fail("error_by_depth", "(not a list)", "a list of depths and errors");
        for (const YAML::Node& item : table) {
            const Section row(path, "calibration.error_by_depth", item, {"depth_m", "error_px"});
            const double depth = row.depth("depth_m");
            if (!verdict.by_depth.empty() && !(depth > verdict.by_depth.back().depth))
                row.fail("depth_m", item["depth_m"].Scalar(), "more than that of the row before");
            verdict.by_depth.push_back({depth, read_error(row, "error_px")});
        }
    }
    return verdict;
}

// In quotes, as YAML reads them back.
std::string quoted(const std::string& text) {
    std::string out = "\"";
    for (const char c : text) {
        if (c == '"' || c == '\\') out += '\\';
        out += c == '\n' ? ' ' : c;
    }
    return out + "\"";
}

std::string length_text(double value) { return std::isinf(value) ? ".inf" : text_of(value); }

std::string error_text(const ExpectedError& error) {
    return "[" + length_text(error.median) + ", " + length_text(error.p95) + "]";
}

void write_verdict(std::ostream& out, const Verdict& verdict) {
    const auto word = [](bool value) { return value ? "true" : "false"; };
    out << "calibration:\n"
        << "  trusted: " << word(verdict.trusted) << "\n"
        << "  found: " << word(verdict.found) << "\n"
        << "  reason: " << quoted(verdict.reason) << "\n";
    if (!verdict.advice.empty()) out << "  advice: " << quoted(verdict.advice) << "\n";
    // Median and 95 %, of the reference at 640 px of width.
    out << "  expected_error_px: " << error_text(verdict.expected_error) << "\n";
    if (!verdict.by_depth.empty()) out << "  error_by_depth:\n";
    for (const ErrorAtDepth& row : verdict.by_depth)
        out << "    - {depth_m: " << length_text(row.depth)
            << ", error_px: " << error_text(row.error) << "}\n";
    out << "  frames: " << verdict.frames << "\n"
        << "  date: " << quoted(verdict.date) << "\n"
        << "  software: " << quoted(verdict.software) << "\n";
}

Rig parse_rig(const std::string& path, const YAML::Node& root) {
    const Section file(path, "the file", root,
                       {"format", "version", "reference", "source", "source_from_reference"},
                       {"relative_depth", "source_mirrored", "calibration"});
    if (file.text("format") != "xcalib-rig") file.fail("format", file.text("format"), "xcalib-rig");
    if (file.text("version") != "1" && file.text("version") != "2")
        file.fail("version", file.text("version"), "1 or 2");
    const Section pose(path, "source_from_reference", file.node("source_from_reference"),
                       {"quaternion_wxyz", "translation_m"});
    const std::vector<double> q = pose.numbers("quaternion_wxyz", 4);
    const std::vector<double> t = pose.numbers("translation_m", 3);
    Rig rig;
    rig.reference = read_camera(path, "reference", file.node("reference"));
    rig.source = read_camera(path, "source", file.node("source"));
    rig.source_from_reference.rotation = Eigen::Quaterniond(q[0], q[1], q[2], q[3]);
    rig.source_from_reference.translation = Eigen::Vector3d(t[0], t[1], t[2]);
    if (const YAML::Node node = file.node("relative_depth")) {
        const Section relative(path, "relative_depth", node, {"scale", "shift"});
        rig.relative_depth = RelativeDepth{relative.number("scale"), relative.number("shift")};
    }
    if (file.node("source_mirrored")) {
        rig.source_mirrored = file.flag("source_mirrored");
    }
    if (const YAML::Node node = file.node("calibration"))
        rig.verdict = std::make_shared<const Verdict>(read_verdict(path, node));
    try {
        rig.validate();
    } catch (const std::invalid_argument& error) {
        reject(path, error.what());
    }
    return rig;
}

}  // namespace

Rig load_rig(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    if (!in) throw std::system_error(errno ? errno : EIO, std::generic_category(), path);
    if (std::filesystem::is_directory(path))  // opens, but cannot be read
        throw std::system_error(EISDIR, std::generic_category(), path);
    const std::string text((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
    try {
        return parse_rig(path, YAML::Load(text));
    } catch (const YAML::Exception& error) {
        std::string what = error.what();
        std::replace(what.begin(), what.end(), '\n', ' ');
        reject(path, "not a YAML rig file: " + what);
    }
}

void save_rig(const Rig& rig, const std::string& path) {
    rig.validate();
    const Eigen::Quaterniond& q = rig.source_from_reference.rotation;
    std::ostringstream out;
    out.imbue(std::locale::classic());
    // Software from before version 2 reads what needs nothing of it.
    out << "format: xcalib-rig\nversion: " << (rig.source_mirrored || rig.verdict ? 2 : 1) << "\n";
    write_camera(out, "reference", rig.reference);
    write_camera(out, "source", rig.source);
    out << "source_from_reference:\n"
        << "  quaternion_wxyz: [" << text_of(q.w()) << ", " << text_of(q.x()) << ", "
        << text_of(q.y()) << ", " << text_of(q.z()) << "]\n"
        << "  translation_m: [" << text_of(rig.t().x()) << ", " << text_of(rig.t().y()) << ", "
        << text_of(rig.t().z()) << "]\n";
    if (rig.source_mirrored) out << "source_mirrored: true\n";
    if (rig.relative_depth)  // inverse depth = scale r + shift
        out << "relative_depth:\n"
            << "  scale: " << text_of(rig.relative_depth->scale) << "\n"
            << "  shift: " << text_of(rig.relative_depth->shift) << "\n";
    if (rig.verdict) write_verdict(out, *rig.verdict);
    const std::string beside = path + ".part" + std::to_string(::getpid());
    {
        std::ofstream file(beside, std::ios::binary);
        if (!(file << out.str() << std::flush)) {
            const int code = errno ? errno : EIO;
            file.close();
            std::remove(beside.c_str());
            throw std::system_error(code, std::generic_category(), path);
        }
    }
    if (std::rename(beside.c_str(), path.c_str()) != 0) {
        const int code = errno;
        std::remove(beside.c_str());
        throw std::system_error(code, std::generic_category(), path);
    }
}

}  // namespace xcalib

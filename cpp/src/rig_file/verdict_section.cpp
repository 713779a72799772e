#include "rig_file/verdict_section.hpp"

#include "rig_file/section.hpp"

namespace xcalib {
namespace {

// [median, 95 %]; either may be .inf.
ExpectedError read_error(const Section& section, const char* key) {
    const std::vector<double> values = section.lengths(key, 2);
    return {values[0], values[1]};
}

// In quotes, as YAML reads them back.
std::string yaml_text(const std::string& text) {
    std::string out = "\"";
    for (const char c : text) {
        if (c == '"' || c == '\\') out += '\\';
        out += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
    }
    return out + "\"";
}

std::string length_text(double value) { return std::isinf(value) ? ".inf" : text_of(value); }

std::string error_text(const ExpectedError& error) {
    return "[" + length_text(error.median) + ", " + length_text(error.p95) + "]";
}

}  // namespace

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

void write_verdict(std::ostream& out, const Verdict& verdict) {
    const auto word = [](bool value) { return value ? "true" : "false"; };
    out << "calibration:\n"
        << "  trusted: " << word(verdict.trusted) << "\n"
        << "  found: " << word(verdict.found) << "\n"
        << "  reason: " << yaml_text(verdict.reason) << "\n";
    if (!verdict.advice.empty()) out << "  advice: " << yaml_text(verdict.advice) << "\n";
    // Median and 95 %, of the reference at 640 px of width.
    out << "  expected_error_px: " << error_text(verdict.expected_error) << "\n";
    if (!verdict.by_depth.empty()) out << "  error_by_depth:\n";
    for (const ErrorAtDepth& row : verdict.by_depth)
        out << "    - {depth_m: " << length_text(row.depth)
            << ", error_px: " << error_text(row.error) << "}\n";
    out << "  frames: " << verdict.frames << "\n"
        << "  date: " << yaml_text(verdict.date) << "\n"
        << "  software: " << yaml_text(verdict.software) << "\n";
}

}  // namespace xcalib

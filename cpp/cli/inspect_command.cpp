#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "files.hpp"
#include "xcalib/error.hpp"
#include "xcalib/judge/describe.hpp"
#include "xcalib/rig_file.hpp"

namespace xcalib::cli {
namespace {

Json json_of(const Pinhole& camera) {
    constexpr double kDegree = 3.14159265358979323846 / 180;
    return {{"width", camera.width},
            {"height", camera.height},
            {"fx", camera.fx},
            {"fy", camera.fy},
            {"cx", camera.cx},
            {"cy", camera.cy},
            {"skew", camera.skew},
            {"hfov_deg", camera.hfov() / kDegree},
            {"vfov_deg", camera.vfov() / kDegree}};
}

template <class Vector>
Json list_of(const Vector& values) {
    Json list = Json::array();
    for (const double value : values) list.push_back(number(value));
    return list;
}

Json json_of(const Rig& rig) {
    const RigFacts facts = describe(rig);
    Json centre = Json::array();
    for (const RigFacts::Centre& row : facts.centre)
        centre.push_back({{"depth_m", row.depth ? Json(*row.depth) : Json(nullptr)},
                          {"point_px", list_of(row.point)},
                          {"parallax_px", number(row.parallax)}});
    const Eigen::Quaterniond& q = rig.source_from_reference.rotation;
    return {{"reference", json_of(rig.reference)},
            {"source", json_of(rig.source)},
            {"rotation_deg",
             {{"pan", facts.pan_deg}, {"tilt", facts.tilt_deg}, {"roll", facts.roll_deg}}},
            {"quaternion_wxyz", Json::array({q.w(), q.x(), q.y(), q.z()})},
            {"translation_m", list_of(rig.t())},
            {"position_m", list_of(facts.position)},
            {"baseline_m", facts.baseline},
            {"centre", centre}};
}

void run(const std::string& file, bool as_json, Console& console) {
    if (has_suffix(file, {".bag", ".mcap", ".db3"}) || std::filesystem::is_directory(file))
        throw InputError(file +
                         ": bags are inspected by the Python command, `xcalib inspect`; expected a"
                         " rig file");
    const Rig rig = load_rig(file);
    if (console.json) console.result(json_of(rig));
    else console.line(as_json ? json_of(rig).dump(2) : facts_text(rig));
}

}  // namespace

void add_inspect(CLI::App& app, Console& console) {
    CLI::App* command =
        app.add_subcommand("inspect", "Print what a rig file says, in units one can picture.");
    auto file = std::make_shared<std::string>();
    auto as_json = std::make_shared<bool>(false);
    command->add_option("RIG", *file)->required();
    command->add_flag("--json", *as_json, "Print JSON.");
    command->callback([=, &console] { run(*file, *as_json, console); });
}

}  // namespace xcalib::cli

#include "xcalib/rig_file.hpp"

#include <yaml-cpp/yaml.h>

#include <cmath>
#include <locale>
#include <sstream>
#include <stdexcept>

#include "base/format.hpp"
#include "base/whole_file.hpp"
#include "rig_file/document.hpp"
#include "rig_file/section.hpp"
#include "rig_file/verdict_section.hpp"

namespace xcalib {
namespace {

Lens read_lens(const std::string& path, const std::string& name, const YAML::Node& node) {
    const Section section(path, name, node, {"model", "coefficients"});
    const std::optional<LensModel> model = lens_model_of(section.text("model"));
    if (!model) section.fail("model", section.text("model"), "none, brown or fisheye");
    const std::vector<double> coefficients = section.numbers("coefficients");
    try {
        return Lens(*model, coefficients);
    } catch (const std::invalid_argument& error) {
        reject(path, name + ": " + error.what());
    }
}

Pinhole read_camera(const std::string& path, const char* name, const YAML::Node& node) {
    const Section section(path, name, node, {"width", "height", "fx", "fy", "cx", "cy", "skew"},
                          {"lens"});
    Pinhole camera;
    camera.width = section.size("width");
    camera.height = section.size("height");
    camera.fx = section.number("fx");
    camera.fy = section.number("fy");
    camera.cx = section.number("cx");
    camera.cy = section.number("cy");
    camera.skew = section.number("skew");
    if (const YAML::Node lens = section.node("lens"))
        camera.lens = read_lens(path, std::string(name) + ".lens", lens);
    return camera;
}

// Files written by hand, or with few digits, are off by more than rounding.
Eigen::Quaterniond unit_quaternion(const Section& pose, const std::vector<double>& wxyz) {
    Eigen::Quaterniond q(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
    const double off = std::abs(q.norm() - 1);
    if (!(off <= 1e-3))
        pose.fail("quaternion_wxyz", "of length " + text_of(q.norm()),
                  "w, x, y, z of length 1, to within 0.001");
    // What we have written reads back bit by bit.
    if (off > 1e-12) q.normalize();
    return q;
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
    if (camera.lens.model() == LensModel::none) return;
    out << "  lens:\n    model: " << name_of(camera.lens.model()) << "\n    coefficients: [";
    const char* before = "";
    for (const double value : camera.lens.coefficients()) {
        out << before << text_of(value);
        before = ", ";
    }
    out << "]\n";
}

bool needs_version_2(const Rig& rig) {
    return rig.verdict || rig.source_mirrored || rig.reference.lens.model() != LensModel::none ||
           rig.source.lens.model() != LensModel::none;
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
    rig.source_from_reference.rotation = unit_quaternion(pose, q);
    rig.source_from_reference.translation = Eigen::Vector3d(t[0], t[1], t[2]);
    if (const YAML::Node node = file.node("relative_depth")) {
        const Section relative(path, "relative_depth", node, {"scale", "shift"});
        rig.relative_depth = RelativeDepth{relative.number("scale"), relative.number("shift")};
    }
    if (file.node("source_mirrored")) rig.source_mirrored = file.flag("source_mirrored");
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
    const YAML::Node root = load_document(path);
    try {
        return parse_rig(path, root);
    } catch (const YAML::Exception& error) {
        reject(path, "not a YAML rig file: " + quoted(error.what()));
    }
}

Rig rig_of_text(const std::string& text) {
    return parse_rig("the text of a rig", YAML::Load(text));
}

void save_rig(const Rig& rig, const std::string& path) { write_whole(path, rig_text(rig)); }

std::string rig_text(const Rig& rig) {
    rig.validate();
    const Eigen::Quaterniond& q = rig.source_from_reference.rotation;
    std::ostringstream out;
    out.imbue(std::locale::classic());
    // Software from before version 2 reads what needs nothing of it.
    out << "format: xcalib-rig\nversion: " << (needs_version_2(rig) ? 2 : 1) << "\n";
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
    return out.str();
}

std::vector<std::string> implausible(const Rig& rig) {
    std::vector<std::string> lines;
    const auto say = [&](const std::string& what, double value, const std::string& why) {
        lines.push_back(what + " = " + text_of(value) + " is not plausible: " + why);
    };
    const auto check = [&](const std::string& name, const Pinhole& camera) {
        const double sides[] = {double(camera.width), double(camera.height)};
        const double centres[] = {camera.cx, camera.cy}, focals[] = {camera.fx, camera.fy};
        for (const int axis : {0, 1}) {
            const std::string side = format("%g px", sides[axis]);
            if (!(centres[axis] > -sides[axis] && centres[axis] < 2 * sides[axis]))
                say(name + (axis ? ".cy" : ".cx"), centres[axis],
                    "it lies far outside of the image, of " + side);
            if (!(focals[axis] > sides[axis] / 20 && focals[axis] < 100 * sides[axis]))
                say(name + (axis ? ".fy" : ".fx"), focals[axis],
                    "it is in px, for an image of " + side);
        }
        if (!(std::abs(camera.skew) < 0.1 * camera.fx))
            say(name + ".skew", camera.skew, "the axes of a sensor are square to each other");
    };
    check("reference", rig.reference);
    check("source", rig.source);
    if (!(rig.t().norm() < 10))
        say("the length of translation_m", rig.t().norm(),
            "it is in metres, and rigs are smaller; was it in millimetres?");
    return lines;
}

}  // namespace xcalib

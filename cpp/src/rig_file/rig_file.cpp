#include "xcalib/rig_file.hpp"

#include <yaml-cpp/yaml.h>

#include <charconv>
#include <cmath>
#include <initializer_list>
#include <locale>
#include <sstream>
#include <stdexcept>

#include "base/format.hpp"
#include "base/whole_file.hpp"
#include "rig_file/document.hpp"

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
            if (!known)
                reject(path, "unknown field '" + quoted(key) + "' in " + name_ + ", expected " +
                                 joined(keys) + (optional.size() ? ", and if needed " : "") +
                                 joined(optional) + "; notes go behind a #");
        }
        for (const char* key : keys)
            if (!node[key])
                reject(path, std::string("missing field '") + key + "' in " + name_ +
                                 ", expected " + joined(keys));
    }

    YAML::Node node(const char* key) const { return node_[key]; }

    std::string text(const char* key) const {
        if (!node_[key].IsScalar()) fail(key, "(not a single value)", "text");
        return node_[key].Scalar();
    }

    int size(const char* key) const {
        int value = 0;
        const std::string text = node_[key].IsScalar() ? node_[key].Scalar() : "";
        const char* const end = text.data() + text.size();
        const auto [stopped, error] = std::from_chars(text.data(), end, value);
        if (stopped != end || error != std::errc() || value < 1)
            fail(key, scalar(node_[key]), "a whole number of px, at least 1, as in 640");
        return value;
    }

    double number(const char* key) const { return number(key, node_[key]); }

    std::vector<double> numbers(const char* key, std::size_t count) const {
        const YAML::Node list = node_[key];
        if (!list.IsSequence() || list.size() != count)
            fail(key, list.IsSequence() ? std::to_string(list.size()) + " values" : scalar(list),
                 "a list of " + std::to_string(count) + " numbers");
        return numbers(key);
    }

    std::vector<double> numbers(const char* key) const {
        const YAML::Node list = node_[key];
        if (!list.IsSequence()) fail(key, scalar(list), "a list of numbers");
        std::vector<double> out;
        for (const YAML::Node& item : list) out.push_back(number(key, item));
        return out;
    }

    [[noreturn]] void fail(const char* key, const std::string& value,
                           const std::string& expected) const {
        reject(path_, name_ + "." + key + " = " + quoted(value) + ", expected " + expected);
    }

   private:
    static std::string scalar(const YAML::Node& node) {
        return node.IsScalar() ? node.Scalar() : "(not a single value)";
    }
    static std::string joined(const std::initializer_list<const char*>& names) {
        std::string text;
        for (const char* name : names) text += (text.empty() ? "" : ", ") + std::string(name);
        return text;
    }
    double number(const char* key, const YAML::Node& node) const {
        double value = 0;
        const std::string text = node.IsScalar() ? node.Scalar() : "";
        const char* const end = text.data() + text.size();
        const auto [stopped, error] = std::from_chars(text.data(), end, value);
        // Of a number that is too large or too small there is an error, and no value.
        if (stopped != end || error != std::errc() || !std::isfinite(value))
            fail(key, scalar(node), "a finite number");
        return value;
    }

    const std::string& path_;
    std::string name_;
    YAML::Node node_;
};

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
    return rig.source_mirrored || rig.reference.lens.model() != LensModel::none ||
           rig.source.lens.model() != LensModel::none;
}

Rig parse_rig(const std::string& path, const YAML::Node& root) {
    const Section file(path, "the file", root,
                       {"format", "version", "reference", "source", "source_from_reference"},
                       {"relative_depth", "source_mirrored"});
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
    if (file.node("source_mirrored")) {
        const std::string word = file.text("source_mirrored");
        if (word != "true" && word != "false") file.fail("source_mirrored", word, "true or false");
        rig.source_mirrored = word == "true";
    }
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

#include "xcalib/judge/describe.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/format.hpp"
#include "xcalib/mount.hpp"

namespace xcalib {
namespace {

constexpr double kDegrees = 180 / 3.14159265358979323846;

// With so many decimals, but no line of digits where a file has 1e299 in it.
std::string number_text(const char* pattern, double value) {
    return format(std::abs(value) < 1e7 ? pattern : "%g", value);
}

std::string vector_text(const Eigen::Vector3d& v) {
    return number_text("%+.4f", v.x()) + " " + number_text("%+.4f", v.y()) + " " +
           number_text("%+.4f", v.z());
}

std::string camera_text(const char* name, const Pinhole& c) {
    const auto px = [](double value) { return number_text("%.2f", value); };
    return format("%-10s %dx%d px", name, c.width, c.height) + ", fx " + px(c.fx) + " fy " +
           px(c.fy) +
           format(" px, HFoV %.2f VFoV %.2f deg", c.hfov() * kDegrees, c.vfov() * kDegrees) +
           ", cx " + px(c.cx) + " cy " + px(c.cy) + " px, skew " + number_text("%.3f", c.skew) +
           " px" + (c.lens.bends() ? ", lens " + Lens::word(c.lens) : "") + "\n";
}

std::string error_text(const ExpectedError& error) {
    return format("%.2f px, 95 %% within %.2f px", error.median, error.p95);
}

std::string distance_text(double depth) {
    return std::isinf(depth) ? "infinity" : format("%g m", depth);
}

// What its calibration says of itself.
std::string verdict_text(const Verdict& verdict) {
    std::string text = std::string("\n") + (verdict.trusted ? "trusted    " : "NOT TRUSTED ") +
                       verdict.line() + "\n";
    text += format("calibrated on %d frames, %s, by %s\n", verdict.frames, verdict.date.c_str(),
                   verdict.software.c_str());
    text += "expected error (px of the reference at 640 px of width): half of the pixels within " +
            error_text(verdict.expected_error) + ", over the footage's depths";
    for (const ErrorAtDepth& row : verdict.by_depth)
        text +=
            format("\n  %8s: %s", distance_text(row.depth).c_str(), error_text(row.error).c_str());
    return text;
}

}  // namespace

RigFacts describe(const Rig& rig) {
    const Eigen::Matrix3d axes = rig.R().transpose();  // columns: the source camera's axes
    RigFacts facts;
    facts.pan_deg = std::atan2(axes(0, 2), axes(2, 2)) * kDegrees;
    facts.tilt_deg = std::asin(std::clamp(0 - axes(1, 2), -1.0, 1.0)) * kDegrees;
    facts.roll_deg = std::atan2(axes(1, 0), axes(1, 1)) * kDegrees;
    facts.position = -(axes * rig.t());
    facts.baseline = rig.t().norm();
    const Eigen::Vector3d ray = unproject(rig.reference, (rig.reference.width - 1) / 2.0,
                                          (rig.reference.height - 1) / 2.0, 1);
    const auto point = [&](double inverse_depth) -> Eigen::Vector2d {
        const Eigen::Vector3d x = rig.R() * ray + inverse_depth * rig.t();
        // A point behind the source camera has no image.
        if (!(x.z() > 0))
            return Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
        return project(rig.source, x);
    };
    for (const double depth : {2.0, 5.0, 10.0, 50.0, 0.0}) {
        RigFacts::Centre row;
        if (depth > 0) row.depth = depth;
        row.point = point(depth > 0 ? 1 / depth : 0.0);
        row.parallax = (row.point - point(0.0)).norm();
        facts.centre.push_back(row);
    }
    return facts;
}

std::string facts_text(const Rig& rig) {
    const RigFacts facts = describe(rig);
    std::string text = camera_text("reference", rig.reference) + camera_text("source", rig.source);
    text += format("rotation   pan %+.3f (right), tilt %+.3f (up), roll %+.3f (clockwise) deg\n",
                   facts.pan_deg, facts.tilt_deg, facts.roll_deg);
    const std::string mount = Mount::of(rig).text();
    if (mount != "upright") text += "mount      the source image is " + mount + "\n";
    text += "t          " + vector_text(rig.t()) + " m (source_from_reference)\n";
    text +=
        "position   " + vector_text(facts.position) + " m of the source: right, down, forward\n";
    text += format("baseline   %.4f m\n", facts.baseline);
    text += "the reference image's centre in the source image:";
    for (const RigFacts::Centre& row : facts.centre) {
        const std::string distance =
            distance_text(row.depth.value_or(std::numeric_limits<double>::infinity()));
        text += format("\n  %8s: (%8.2f, %8.2f) px, parallax %6.2f px", distance.c_str(),
                       row.point.x(), row.point.y(), row.parallax);
    }
    if (rig.verdict) text += verdict_text(*rig.verdict);
    return text;
}

}  // namespace xcalib

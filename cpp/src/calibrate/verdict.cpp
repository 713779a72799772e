#include "calibrate/verdict.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>
#include <string>
#include <vector>

#include "base/format.hpp"
#include "base/median.hpp"
#include "calibrate/depth_check.hpp"
#include "calibrate/error_model.hpp"
#include "calibrate/judging.hpp"
#include "calibrate/plausible.hpp"
#include "calibrate/shared_detail.hpp"
#include "calibrate/visible_shift.hpp"
#include "solve/solve.hpp"

namespace xcalib {
namespace {

constexpr double kPi = 3.14159265358979323846;

// Half resolution: fine enough to separate a fit from a near miss, a quarter of the cost.

// NEC of the same rig turned off its place: what the footage gives where nothing is aligned.
struct Baseline {
    double mean, deviation;
};

Baseline displaced(const Level& level, const Rig& rig, int num_threads) {
    constexpr int kDirections = 8;
    const double width = rig.reference.width_by_focal();  // about an angle
    std::vector<double> values;
    for (double radius : {0.04, 0.07, 0.10})
        for (int i = 0; i < kDirections; ++i) {
            const double angle = 2 * kPi * i / kDirections;
            const Eigen::Vector3d turn(std::sin(angle), std::cos(angle), 0);
            values.push_back(
                pooled(level, turn_source(rig, radius * width * turn), num_threads).nec);
        }
    Baseline out{0, 0};
    for (double v : values) out.mean += v / static_cast<double>(values.size());
    for (double v : values)
        out.deviation += (v - out.mean) * (v - out.mean) / static_cast<double>(values.size() - 1);
    out.deviation = std::sqrt(out.deviation);
    return out;
}

// Deviations by which edges that agree stand out from displaced ones.
constexpr double kContrast = 5.0;

// Why a rig is not to be trusted, and what to do about it; none where it is.
std::optional<Objection> objection(const CalibrationReport& report, const WorkingImages& images,
                                   const Rig& rig, const Halves& halves, const Plan& plan,
                                   const ErrorField& errors) {
    constexpr double kShare = 0.05, kSameSign = 0.6;
    // Where two searches agree, flow would have to see much to know better: of few frames it is
    // itself wrong by that much.
    const double most_shift = halves.independent ? 6.0 : 3.0;
    constexpr std::size_t kFewFrames = 8;
    const Verdict& verdict = report.verdict;
    const bool stands_out = report.contrast >= kContrast;
    if (images.size() < 2)
        return Objection{"1 image pair, and nothing to check the rig by",
                         "calibrate on 2 frames at least, better on 8 or more"};
    if (report.valid_share < kShare)
        return Objection{format("the source covers %.0f %% of the reference's edges, expected at "
                                "least %.0f %%",
                                100 * report.valid_share, 100 * kShare),
                         "do both cameras look at the same scene?"};
    if (!verdict.found && !halves.independent && !stands_out)
        return Objection{format("edges agree hardly better than displaced ones: NEC stands out by "
                                "%.1f deviations, expected at least %.0f",
                                report.contrast, kContrast),
                         "leave out --search off, or start from a better rig"};
    if (!verdict.found) {
        const std::string apart =
            std::isfinite(report.repeatability_px)
                ? format("two calibrations of half of the frames each lie %.1f px apart",
                         report.repeatability_px)
                : std::string("half of the frames by themselves give no rig at all");
        if (images.size() < kFewFrames)
            return Objection{apart, format("%zu frames are few: give 8 or more, of different "
                                           "scenes",
                                           images.size())};
        if (stands_out)
            return Objection{apart + ", though edges of all frames meet",
                             "half of the frames show too little, or the scenes repeat themselves: "
                             "give more, of different scenes"};
        return Objection{
            apart + ", and edges of all frames agree hardly better than displaced ones",
            "do the frames belong together (same moment, same order, not exchanged), "
            "and do both images show edges?"};
    }
    if (const double same = same_sign(images, rig, plan.options.num_threads); same > kSameSign)
        return Objection{
            format("edges of both images have the same sign (%.2f, 1 for an image and itself): the "
                   "source shows what the reference does",
                   same),
            "is it the same footage twice, or are visible edges drawn into it (MSX)? Give thermal "
            "images as they come from the sensor"};
    if (auto wrong = wrong_depth(
            check_depth(images, rig, {report.near_m, report.middle_m, report.far_m}, plan)))
        return wrong;
    if (auto implausible = implausible_in(rig, report.near_m, plan, errors)) return implausible;
    if (report.visible_shift_px > most_shift)
        return Objection{format("flow between the registered images still sees a shift of %.1f px, "
                                "expected at most %.0f",
                                report.visible_shift_px, most_shift),
                         "does a lens bend the images, or is the depth of other frames?"};
    const Tolerance& tolerance = plan.options.tolerance;
    const ExpectedError& expected = verdict.expected_error;
    if (expected.median > tolerance.median || expected.p95 > tolerance.p95)
        return Objection{
            format(
                "the expected error is %.1f px, 95 %% within %.1f px: more than the tolerance of "
                "%g and %g px",
                expected.median, expected.p95, tolerance.median, tolerance.p95),
            format("give more frames than these %zu, with edges at all depths, or a wider "
                   "--tolerance",
                   images.size())};
    return std::nullopt;
}

}  // namespace

std::string today() {
    const std::time_t now = std::time(nullptr);
    std::tm parts{};
    gmtime_r(&now, &parts);
    char text[16];
    std::strftime(text, sizeof text, "%Y-%m-%d", &parts);
    return text;
}

std::string this_software() { return "xcalib " XCALIB_VERSION; }

void judge(const WorkingImages& images, const Level& finest, const Rig& rig, const Halves& halves,
           const Plan& plan, CalibrationReport& report) {
    const int num_threads = plan.options.num_threads;
    // Where halves were found apart, contrast only helps to say why they disagree.
    constexpr std::size_t kFrames = 4;
    const Level level = make_level(halves.independent ? images.spread(kFrames) : images,
                                   kJudgedFactor, rig, num_threads);
    const double here = pooled(level, rig, num_threads).nec;
    const Baseline baseline = displaced(level, rig, num_threads);
    report.baseline_nec = baseline.mean;
    report.contrast = baseline.deviation > 0 ? (here - baseline.mean) / baseline.deviation : 0.0;
    report.repeatability_px = distance(halves, images);
    report.visible_shift_px = visible_shift(images, rig, num_threads);

    std::vector<float> depths;
    for (const Image& depth : images.pyramid.at(8).depths)
        for (const float z : depth.pixels)
            if (z > 0) depths.push_back(z);
    if (!depths.empty()) {
        report.near_m = quantile(depths, 0.05);
        report.middle_m = quantile(depths, 0.5);
        report.far_m = quantile(depths, 0.95);
    }

    Verdict& verdict = report.verdict;
    verdict.frames = static_cast<int>(images.size());
    verdict.date = today();
    verdict.software = this_software();
    verdict.found = agree(halves, images) && (halves.independent || report.contrast >= kContrast);
    const ErrorModel model(images, finest, rig, halves, plan);
    report.errors = std::make_shared<const ErrorField>(model.field());
    report.weak_directions = model.weak_directions();
    verdict.expected_error = model.over_footage();
    verdict.by_depth.clear();
    if (!plan.options.relative_depth)
        for (const double depth :
             {2.0, 3.0, 5.0, 10.0, 20.0, 50.0, std::numeric_limits<double>::infinity()})
            verdict.by_depth.push_back({depth, model.field().at(1 / depth)});

    const std::optional<Objection> against =
        objection(report, images, rig, halves, plan, model.field());
    verdict.trusted = !against;
    verdict.reason = against ? against->reason
                             : format(
                                   "expected error %.2f px, 95 %% within %.2f px; two halves of "
                                   "the frames agree to %.2f px",
                                   verdict.expected_error.median, verdict.expected_error.p95,
                                   report.repeatability_px);
    verdict.advice = against ? against->advice : "";
    report.converged = verdict.trusted;
    report.message = verdict.line();
}

}  // namespace xcalib

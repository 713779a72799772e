#include "xcalib/verdict_on.hpp"

#include "base/format.hpp"
#include "base/median.hpp"
#include "base/parallel.hpp"
#include "calibrate/find_mounts.hpp"
#include "calibrate/halves.hpp"
#include "calibrate/judging.hpp"
#include "calibrate/verdict.hpp"
#include "geometry/projector.hpp"
#include "solve/solve.hpp"

namespace xcalib {
namespace {

// Only the pose moves.
Plan pose_plan(const Rig& rig, int num_threads) {
    CalibrationOptions options;
    options.reference_camera = rig.reference;
    options.source_camera = rig.source;
    options.search.mode = SearchMode::off;
    options.flow = FlowMode::off;
    options.relative_depth = rig.relative_depth;
    options.num_threads = num_threads;
    return Plan(options);
}

struct Refit {
    Rig rig;
    Level level;
    double nec = 0, valid_share = 0;
};

Refit refit(const WorkingImages& images, const Rig& rig, const Plan& plan) {
    Refit out{rig, {}};
    for (const int factor : {kCoarse, kJudgedFactor}) {
        out.level = make_level(images, factor, out.rig, plan.options.num_threads);
        const double share = pooled(out.level, out.rig, plan.options.num_threads).valid_share;
        const LevelReport report =
            solve_level(out.level, {}, 2, share_limit(share), 1e-6, plan, out.rig, out.rig);
        out.nec = report.nec;
        out.valid_share = report.valid_share;
    }
    return out;
}

// Lengths between where two rigs send the pixels of the footage that the source sees.
ExpectedError shift_between(const WorkingImages& images, const Rig& a, const Rig& b) {
    constexpr int kStep = 8;
    const double unit = kUnitWidth / (a.reference.width * a.source_density().x());
    std::vector<double> lengths;
    for (const Image& depth : images.pyramid.at(kJudgedFactor).depths)
        for (int y = kStep / 2; y < depth.height; y += kStep)
            for (int x = kStep / 2; x < depth.width; x += kStep) {
                const double z = depth.row(y)[x],
                             u = (x + 0.5) * a.reference.width / depth.width - 0.5,
                             v = (y + 0.5) * a.reference.height / depth.height - 0.5;
                if (!(z > 0)) continue;
                const Eigen::Vector2d at = transfer(a, u, v, z);
                if (!(at.x() >= 0 && at.y() >= 0 && at.x() <= a.source.width - 1 &&
                      at.y() <= a.source.height - 1))
                    continue;
                lengths.push_back(unit * (at - transfer(b, u, v, z)).norm());
            }
    if (lengths.empty()) return {};
    return {quantile(lengths, 0.5), quantile(lengths, 0.95)};
}

}  // namespace

Verdict verdict_on(const std::vector<ImageView>& references, const std::vector<ImageView>& sources,
                   const std::vector<ImageView>& depths, const Rig& given, int num_threads) {
    validate_frames(references, sources, depths);
    const WorkersOfThread workers(resolve_threads(num_threads));
    Rig rig = fitted(given, references[0].width, references[0].height, sources[0].width,
                     sources[0].height);
    if (given.source_mirrored) rig = with_flipped_source(rig);
    const Plan plan = pose_plan(rig, num_threads);
    std::vector<int> every(references.size());
    for (std::size_t i = 0; i < every.size(); ++i) every[i] = static_cast<int>(i);
    WorkingImages images = make_working_images(references, sources, depths, every, plan);
    if (given.source_mirrored) images = with_mirrored_sources(images);

    const Refit found = refit(images, rig, plan);
    CalibrationReport report;
    report.nec = found.nec;
    report.valid_share = found.valid_share;
    judge(images, found.level, found.rig, refit_halves(images, found.rig, plan, found.valid_share),
          plan, report);
    Verdict verdict = report.verdict;
    const ExpectedError shift = shift_between(images, rig, found.rig);
    const Tolerance tolerance;
    if (!verdict.trusted || (shift.median <= tolerance.median && shift.p95 <= tolerance.p95))
        return verdict;
    verdict.trusted = false;
    verdict.reason = format(
        "these frames have the source %.1f px from where the rig has it, 95 %% "
        "within %.1f px",
        shift.median, shift.p95);
    verdict.advice = "has the source moved since? Calibrate anew";
    return verdict;
}

}  // namespace xcalib

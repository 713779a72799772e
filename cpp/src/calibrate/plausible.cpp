#include "calibrate/plausible.hpp"

#include <algorithm>
#include <cmath>

#include "base/format.hpp"
#include "xcalib/parameters.hpp"

namespace xcalib {
namespace {

// A quantity, its standard deviation, and the most that a rig has; beyond it by chance alone it is
// still plausible.
struct Quantity {
    double value, deviation, limit;

    bool implausible() const { return std::abs(value) - 2 * deviation > limit; }
};

}  // namespace

std::optional<Objection> implausible_in(const Rig& rig, double near, const Plan& plan,
                                        const ErrorModel& model) {
    const bool known = plan.options.source_camera.has_value();
    const SolverParameters::Camera source = solver_from_rig(rig).source;
    const double focal = std::exp(source.log_f[0]);  // in widths
    const Quantity skew{source.skew_share[0] / focal, model.deviation_of(kSourceSkew) / focal,
                        0.03};
    if (!known && skew.implausible())
        return Objection{format("the source's pixels are skewed by %.1f +- %.1f %%",
                                100 * skew.value, 100 * skew.deviation),
                         "does its shutter roll while the rig moves?"};
    const double square = std::log(static_cast<double>(rig.source.width) / rig.source.height);
    const Quantity aspect{
        source.log_f[1] - source.log_f[0] - square,  // the logarithm of fy / fx
        std::hypot(model.deviation_of(kSourceLogFx), model.deviation_of(kSourceLogFy)), 0.1};
    if (!known && aspect.implausible())
        return Objection{format("the source's fy is %.0f +- %.0f %% of its fx",
                                100 * std::exp(aspect.value), 100 * aspect.deviation),
                         "has one of the images been stretched?"};
    const Quantity center_x{source.center[0] - 0.5, model.deviation_of(kSourceCx), 0.4},
        center_y{source.center[1] - 0.5, model.deviation_of(kSourceCy), 0.4};
    if (!known && (center_x.implausible() || center_y.implausible()))
        return Objection{
            format("the source's principal point lies (%.0f, %.0f) %% of its size off its centre",
                   100 * center_x.value, 100 * center_y.value),
            "has it been cropped? Give what is known by --source-intrinsics"};
    if (plan.options.relative_depth) return std::nullopt;
    const double z = -(rig.R().transpose() * rig.t()).z();
    const Quantity behind{z, model.deviation_of(kTranslationZ), 0.35};
    if (behind.implausible())
        return Objection{format("the source would stand %.2f +- %.2f m %s the reference",
                                std::abs(z), behind.deviation, z > 0 ? "before" : "behind"),
                         "are its frames late, or early, while the rig drives? See --time-offset"};
    const double baseline = rig.t().norm();
    const double deviation =
        std::hypot(model.deviation_of(kTranslationX), model.deviation_of(kTranslationY));
    if (Quantity{baseline, deviation, std::max(0.5 * near, 0.35)}.implausible())
        return Objection{
            format("the cameras would stand %.2f +- %.2f m apart before things at %.1f m", baseline,
                   deviation, near),
            "is the depth in metres? See --depth-scale"};
    return std::nullopt;
}

}  // namespace xcalib

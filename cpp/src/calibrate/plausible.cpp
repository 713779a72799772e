#include "calibrate/plausible.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "base/format.hpp"
#include "geometry/gauge.hpp"
#include "solve/solve.hpp"
#include "xcalib/parameters.hpp"

namespace xcalib {
namespace {

// A quantity, its standard deviation, and the most that a rig has; beyond it by chance alone it is
// still plausible.
struct Quantity {
    double value, deviation, limit;

    bool implausible() const { return std::abs(value) - 2 * deviation > limit; }
};

// What a rig is judged by.
enum { kSkew, kAspect, kCenterX, kCenterY, kForward, kBaseline, kNumFigures };
using Figures = Eigen::Matrix<double, kNumFigures, 1>;

Figures figures_of(const Rig& rig) {
    const SolverParameters::Camera source = solver_from_rig(rig).source;
    const double square = std::log(static_cast<double>(rig.source.width) / rig.source.height);
    Figures out;
    out[kSkew] = source.skew_share[0] / std::exp(source.log_f[0]);
    out[kAspect] = source.log_f[1] - source.log_f[0] - square;  // the logarithm of fy / fx
    out[kCenterX] = source.center[0] - 0.5;
    out[kCenterY] = source.center[1] - 0.5;
    out[kForward] = -(rig.R().transpose() * rig.t()).z();  // [m]
    out[kBaseline] = rig.t().norm();                       // [m]
    return out;
}

// How they scatter with the frames.
Figures deviations_of(const ErrorField& errors, const Rig& rig) {
    const auto of = [&](int parameter) { return errors.deviation_of(parameter); };
    Figures out;
    out[kSkew] = of(kSourceSkew) / std::exp(solver_from_rig(rig).source.log_f[0]);
    out[kAspect] = std::hypot(of(kSourceLogFx), of(kSourceLogFy));
    out[kCenterX] = of(kSourceCx);
    out[kCenterY] = of(kSourceCy);
    out[kForward] = of(kTranslationZ);
    out[kBaseline] = std::hypot(of(kTranslationX), of(kTranslationY));
    return out;
}

// Pixels do not tell the camera of the reference where no lens bends: by how much the figures
// differ between those that it may be. Where the optical axes point apart they differ much: the
// skew is about (1 - s^2) times both angles, for a focal length that is wrong by s.
Figures spread_by_reference(const Rig& rig, const Plan& plan) {
    constexpr double kGivenField = 0.05;  // a field of view off a data sheet, as a share
    Figures out = Figures::Zero();
    const bool bends = rig.source.lens.bends() || rig.reference.lens.bends();
    if (!plan.fits_gauge || bends) return out;
    const double focal = plan.options.reference_hfov_deg ? kGivenField : kLogFocalDeviation;
    const double center = kCenterDeviation * rig.reference.width;
    const auto add = [&](const Rig& more, const Rig& less) {
        const Figures half = (figures_of(more) - figures_of(less)) / 2;
        out += half.cwiseAbs2();
    };
    add(with_other_reference(rig, std::exp(focal), 0, 0),
        with_other_reference(rig, std::exp(-focal), 0, 0));
    add(with_other_reference(rig, 1, center, 0), with_other_reference(rig, 1, -center, 0));
    add(with_other_reference(rig, 1, 0, center), with_other_reference(rig, 1, 0, -center));
    out[kBaseline] = 0;  // judged by its magnitude, which a focal length does not change
    return out.cwiseSqrt();
}

}  // namespace

std::optional<Objection> implausible_in(const Rig& rig, double near, const Plan& plan,
                                        const ErrorField& errors) {
    const Figures values = figures_of(rig), drawn = deviations_of(errors, rig),
                  gauge = spread_by_reference(rig, plan);
    const auto quantity = [&](int figure, double limit) {
        return Quantity{values[figure], std::hypot(drawn[figure], gauge[figure]), limit};
    };
    if (!plan.options.source_camera) {
        const Quantity skew = quantity(kSkew, 0.03), aspect = quantity(kAspect, 0.1);
        if (skew.implausible())
            return Objection{format("the source's pixels are skewed by %.1f +- %.1f %%",
                                    100 * skew.value, 100 * skew.deviation),
                             "does its shutter roll while the rig moves? See --source-readout"};
        if (aspect.implausible())
            return Objection{format("the source's fy is %.0f +- %.0f %% of its fx",
                                    100 * std::exp(aspect.value), 100 * aspect.deviation),
                             "has one of the images been stretched?"};
        if (quantity(kCenterX, 0.4).implausible() || quantity(kCenterY, 0.4).implausible())
            return Objection{format("the source's principal point lies (%.0f, %.0f) %% of its size "
                                    "off its centre",
                                    100 * values[kCenterX], 100 * values[kCenterY]),
                             "has it been cropped? Give what is known by --source-intrinsics"};
    }
    if (plan.options.relative_depth) return std::nullopt;
    const Quantity forward = quantity(kForward, 0.35);
    if (forward.implausible())
        return Objection{format("the source would stand %.2f +- %.2f m %s the reference",
                                std::abs(forward.value), forward.deviation,
                                forward.value > 0 ? "before" : "behind"),
                         "are its frames late, or early, while the rig drives? See --time-offset"};
    const Quantity baseline = quantity(kBaseline, std::max(0.5 * near, 0.35));
    if (baseline.implausible())
        return Objection{
            format("the cameras would stand %.2f +- %.2f m apart before things at %.1f m",
                   baseline.value, baseline.deviation, near),
            "is the depth in metres? See --depth-scale"};
    return std::nullopt;
}

}  // namespace xcalib

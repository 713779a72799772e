#include "xcalib/calibration_report.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <stdexcept>

#include "base/format.hpp"

namespace xcalib {
namespace {

constexpr double kDegrees = 180 / 3.14159265358979323846;

}  // namespace

const LagFit& LagReport::at(int lag) const {
    const auto found =
        std::find_if(fits.begin(), fits.end(), [lag](const LagFit& fit) { return fit.lag == lag; });
    if (found == fits.end())
        throw std::out_of_range("lag " + std::to_string(lag) + " was not looked at");
    return *found;
}

std::string LagReport::line() const {
    if (fits.empty()) return "the footage is no sequence, lags were not looked at";
    if (change != 0)
        return format("the source's lag changes by %+d %s between the halves of the footage",
                      change, std::abs(change) == 1 ? "frame" : "frames");
    const auto best = std::max_element(fits.begin(), fits.end(), [](const auto& a, const auto& b) {
        return (a.lag ? a.gain : -INFINITY) < (b.lag ? b.gain : -INFINITY);
    });
    if (frames == 0)
        return format("no lag fits better (the best other, %+d: NEC %+.4f +- %.4f)", best->lag,
                      best->gain, best->error);
    const LagFit& found = at(frames);
    return format("the source is %d %s %s (NEC %+.4f +- %.4f over %d frames)", std::abs(frames),
                  std::abs(frames) == 1 ? "frame" : "frames", frames > 0 ? "late" : "early",
                  found.gain, found.error, found.frames);
}

std::string CalibrationReport::brief() const {
    return format(
        "%s: %s; %zu pairs, depths of %.3g to %.3g m (median %.3g), NEC %.3f (%.3f when "
        "displaced), %.0f %% of the edges covered, %.1f s",
        converged ? "converged" : "NOT converged", message.c_str(), frames.size(), near_m, far_m,
        middle_m, nec, baseline_nec, 100 * valid_share, seconds);
}

std::string CalibrationReport::full() const {
    std::string text = brief() + "\n";
    text += format(
        "working size %d x %d px; of %.1f s, %.1f to prepare images, %.1f search, %.1f warp, "
        "%.1f values, %.1f Jacobians, %.1f solver\n",
        working_width, working_height, seconds, time.prepare, time.search, time.warp, time.value,
        time.jacobian, time.solver);
    for (const std::string& weak : weak_directions)
        text += "for a tenth of a pixel could slide " + weak + "\n";
    text += "candidate   score   corr  overlap  refined  HFoV reference / source [deg]\n";
    for (std::size_t i = 0; i < candidates.size(); ++i) {
        const CandidateReport& c = candidates[i];
        text += format("%9zu  %6.3f  %5.3f  %7.2f  %7.4f  %5.1f / %5.1f\n", i + 1, c.score,
                       c.correlation, c.overlap, c.refined_nec,
                       c.refined.reference.hfov() * kDegrees, c.refined.source.hfov() * kDegrees);
    }
    if (!lag.fits.empty()) {
        text += "lags: " + lag.line() +
                "\nlag [frames]  frames  level     NEC  gain                 t [m]\n";
        for (const LagFit& fit : lag.fits)
            text += format("%+12d  %6d  1/%-3d  %.4f  %+.4f +- %.4f  %+8.4f %+8.4f %+8.4f\n",
                           fit.lag, fit.frames, fit.factor, fit.nec, fit.gain, fit.error,
                           fit.rig.t().x(), fit.rig.t().y(), fit.rig.t().z());
    }
    text +=
        "level  stage  size       iterations  cost                  NEC     valid  condition   s  "
        "stopped\n";
    for (const LevelReport& l : levels)
        text +=
            format("1/%-3d  %5d  %4d x %-4d  %9d  %.5f -> %.5f  %.4f  %4.0f %%  %9.1e  %3.1f  %s\n",
                   l.factor, l.stage, l.width, l.height, l.iterations, l.initial_cost, l.final_cost,
                   l.nec, 100 * l.valid_share, l.condition_number, l.seconds, l.stopped.c_str());
    if (lens.tried)
        text += format(
            "lens of the source: %s; frames gain %.4f +- %.4f NEC by the last coefficient tried\n",
            lens.coefficients == 0   ? "none"
            : lens.coefficients == 1 ? "k1"
                                     : "k1 and k2",
            lens.gain, lens.gain_deviation);
    return text;
}

}  // namespace xcalib

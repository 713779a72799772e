#include "xcalib/verdict.hpp"

#include <cmath>
#include <cstddef>

namespace xcalib {

std::string Verdict::line() const { return advice.empty() ? reason : reason + "; " + advice; }

ExpectedError Verdict::error_at(double depth) const {
    constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
    if (by_depth.empty() || !(depth > 0)) return {kNaN, kNaN};
    const double inverse = 1 / depth;
    const ErrorAtDepth& nearest = by_depth.front();
    if (inverse >= 1 / nearest.depth) {
        const double farther_off = inverse * nearest.depth;
        return {nearest.error.median * farther_off, nearest.error.p95 * farther_off};
    }
    std::size_t next = 1;
    while (next < by_depth.size() && 1 / by_depth[next].depth > inverse) ++next;
    if (next == by_depth.size()) return by_depth.back().error;
    const ErrorAtDepth &near = by_depth[next - 1], &far = by_depth[next];
    const double share = (inverse - 1 / far.depth) / (1 / near.depth - 1 / far.depth);
    const auto between = [share](double a, double b) { return b + share * (a - b); };
    return {between(near.error.median, far.error.median), between(near.error.p95, far.error.p95)};
}

}  // namespace xcalib

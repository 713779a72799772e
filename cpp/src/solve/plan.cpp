#include "solve/plan.hpp"

namespace xcalib {

Plan::Plan(const CalibrationOptions& given, const FlowEstimator& flow, const Parts& kept)
    : options(given), estimator(flow), parts(kept) {
    options.validate();
    mount = options.mount.value_or(Mount{});
    searches = options.solver != Solver::adam && options.search.mode != SearchMode::off;
    // A caller who gives an estimator wants it used.
    const bool wanted =
        options.flow == FlowMode::on || (options.flow == FlowMode::automatic && flow);
    uses_flow = wanted || (options.flow == FlowMode::automatic && !searches);
    from_coarsest = wanted;
    const bool lens_is_known =
        options.source_camera || (options.source_lens && !options.optimize_lens);
    // Depth of unknown shift takes up what bends, and is told apart from it by nothing.
    fits_gauge = !options.reference_camera && !options.optimize_reference;
    estimates_lens = options.solver == Solver::ceres && !lens_is_known &&
                     (options.optimize_lens || !options.relative_depth);
    if (options.optimize_lens && options.solver == Solver::adam) lens_coefficients = 2;
}

}  // namespace xcalib

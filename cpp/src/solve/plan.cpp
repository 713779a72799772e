#include "solve/plan.hpp"

namespace xcalib {

Plan::Plan(const CalibrationOptions& given, const FlowEstimator& flow, const Parts& kept)
    : options(given), estimator(flow), parts(kept) {
    options.validate();
    searches = options.solver != Solver::adam && options.search.mode != SearchMode::off;
    // A caller who gives an estimator wants it used.
    const bool wanted =
        options.flow == FlowMode::on || (options.flow == FlowMode::automatic && flow);
    uses_flow = wanted || (options.flow == FlowMode::automatic && !searches);
    from_coarsest = wanted;
}

}  // namespace xcalib

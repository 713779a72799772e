#include "solve/solve.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <chrono>
#include <cmath>

#include "base/parallel.hpp"
#include "geometry/projector.hpp"
#include "solve/nec_cost.hpp"

namespace xcalib {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180;

// x - x0: Eq. (camera_regularization) once a Huber loss acts on its norm.
class HoldCost : public ceres::CostFunction {
   public:
    explicit HoldCost(std::vector<double> held) : held_(std::move(held)) {
        mutable_parameter_block_sizes()->push_back(static_cast<int>(held_.size()));
        set_num_residuals(static_cast<int>(held_.size()));
    }
    bool Evaluate(double const* const* x, double* residuals, double** jacobians) const override {
        const Eigen::Index size = static_cast<Eigen::Index>(held_.size());
        Eigen::Map<Eigen::VectorXd>(residuals, size) =
            Eigen::Map<const Eigen::VectorXd>(x[0], size) -
            Eigen::Map<const Eigen::VectorXd>(held_.data(), size);
        if (jacobians && jacobians[0])
            Eigen::Map<Eigen::MatrixXd>(jacobians[0], size, size).setIdentity();
        return true;
    }

   private:
    std::vector<double> held_;
};

// How many of k1 and k2 move. Coarse levels hardly see what bends: there, only where the start has
// some.
int free_lens_coefficients(const Plan& plan, int stage, int factor, const Rig& rig) {
    if (stage == 1 || !has_lens_parameters(rig.source.lens)) return 0;
    if (plan.estimates_lens && rig.source.lens.bends()) return std::max(1, plan.lens_coefficients);
    return factor < kCoarse ? plan.lens_coefficients : 0;
}

// What does not move in a stage, for Ceres.
void freeze(ceres::Problem& problem, SolverParameters& p, int stage,
            const CalibrationOptions& options, const Moving& moving) {
    const int lens = moving.lens_coefficients;
    const bool source_known = options.source_camera.has_value();
    const bool reference_free = options.optimize_reference && !options.reference_camera;
    if (stage == 1) {
        problem.SetManifold(p.quaternion, new PanTiltManifold);
        problem.SetManifold(p.translation, new ceres::SubsetManifold(3, {2}));
    } else {
        problem.SetManifold(p.quaternion, new ceres::QuaternionManifold);
    }
    for (double* block : {p.source.center, p.source.skew_share})
        if (stage == 1 || source_known) problem.SetParameterBlockConstant(block);
    if (source_known) problem.SetParameterBlockConstant(p.source.log_f);
    if (lens == 0) problem.SetParameterBlockConstant(p.source_lens);
    if (lens == 1) problem.SetManifold(p.source_lens, new ceres::SubsetManifold(2, {1}));
    for (double* block : {p.reference.log_f, p.reference.center, p.reference.skew_share})
        if (!reference_free || (stage == 1 && block != p.reference.log_f)) {
            if (moving.gauge && block == p.reference.log_f)
                problem.SetManifold(block, new TogetherManifold);
            else if (!moving.gauge || block != p.reference.center)
                problem.SetParameterBlockConstant(block);
        }
}

// Footage tells little of the reference's camera, and only by what the source's lens bends:
// ordinary cameras are preferred by as much as a thousandth of NEC is worth.
void hold_gauge(ceres::Problem& problem, SolverParameters& p, const Pinhole& size,
                const CalibrationOptions& options) {
    constexpr double kWorth = 1e-3;
    const double hfov = options.reference_hfov_deg.value_or(55) * kDegree;
    const double log_f = std::log(0.5 / std::tan(hfov / 2));
    const auto hold = [&](std::vector<double> at, double deviation, double* block) {
        problem.AddResidualBlock(
            new HoldCost(std::move(at)),
            new ceres::ScaledLoss(nullptr, kWorth / (deviation * deviation), ceres::TAKE_OWNERSHIP),
            block);
    };
    hold({log_f, log_f + std::log(static_cast<double>(size.width) / size.height)},
         std::sqrt(2.0) * kLogFocalDeviation, p.reference.log_f);
    hold({0.5, 0.5}, kCenterDeviation, p.reference.center);
}

// Condition number by the free parameters, with columns scaled to unit norm: it shows coupled
// directions, not units.
double condition_number(ceres::Problem& problem) {
    std::vector<double*> blocks;
    problem.GetParameterBlocks(&blocks);
    ceres::Problem::EvaluateOptions free;
    for (double* block : blocks)
        if (!problem.IsParameterBlockConstant(block)) free.parameter_blocks.push_back(block);
    ceres::CRSMatrix sparse;
    problem.Evaluate(free, nullptr, nullptr, nullptr, &sparse);
    Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(sparse.num_rows, sparse.num_cols);
    for (int row = 0; row < sparse.num_rows; ++row)
        for (int k = sparse.rows[row]; k < sparse.rows[row + 1]; ++k)
            jacobian(row, sparse.cols[k]) = sparse.values[k];
    for (Eigen::Index c = 0; c < jacobian.cols(); ++c)
        if (const double norm = jacobian.col(c).norm(); norm > 0) jacobian.col(c) /= norm;
    const Eigen::VectorXd values =
        Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(jacobian.transpose() * jacobian)
            .eigenvalues();
    return values[values.size() - 1] / std::max(values[0], 1e-300);
}

}  // namespace

Moving moving_parameters(int stage, int factor, const Plan& plan, const Rig& rig) {
    const CalibrationOptions& options = plan.options;
    Moving moving;
    moving.lens_coefficients = free_lens_coefficients(plan, stage, factor, rig);
    const bool bends = rig.source.lens.bends() && factor < kCoarse;
    moving.gauge = plan.fits_gauge && stage == 2 && (moving.lens_coefficients > 0 || bends);
    const bool source_free = !options.source_camera;
    const bool reference_free = options.optimize_reference && !options.reference_camera;
    for (int p = 0; p < kNumParameters; ++p) {
        const bool late = p == kRotationZ || p == kTranslationZ || p == kSourceCx ||
                          p == kSourceCy || p == kSourceSkew || p >= kReferenceCx;
        const bool known = (p <= kSourceSkew && !source_free) ||
                           (p >= kSourceK1 + moving.lens_coefficients) ||
                           (p >= kReferenceLogFx && p < kSourceK1 && !reference_free &&
                            !(moving.gauge && p <= kReferenceCy));
        if (!known && !(stage == 1 && late)) moving.parameters.add(p);
    }
    return moving;
}

double seconds_now() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch())
        .count();
}

NecValue pooled(const Level& level, const Rig& rig, int num_threads) {
    const Rig at_level = level.rig_at(rig);
    std::vector<NecValue> values(level.pairs.size());
    parallel_each(static_cast<int>(values.size()), num_threads,
                  [&](int i) { values[i] = level.pairs[i]->evaluate(at_level); });
    NecValue sum;
    for (std::size_t i = 0; i < values.size(); ++i) {
        sum.nec += level.weights[i] * values[i].nec;
        sum.norm += values[i].norm;
        sum.aligned += level.weights[i] * values[i].aligned;
        sum.valid_share += values[i].valid_share / static_cast<double>(values.size());
    }
    return sum;
}

LevelReport report_on(const Level& level, int stage, const Rig& rig, int num_threads) {
    const NecValue value = pooled(level, rig, num_threads);
    LevelReport report;
    report.factor = level.factor;
    report.stage = stage;
    report.width = level.width;
    report.height = level.height;
    report.nec = value.nec;
    report.aligned = value.aligned;
    report.valid_share = value.valid_share;
    return report;
}

LevelReport solve_level(const Level& level, const std::vector<FlowTargets>& flow, int stage,
                        double share_limit, double tolerance, const Plan& plan, const Rig& anchor,
                        Rig& rig) {
    const double start = seconds_now();
    const CalibrationOptions& options = plan.options;
    if (!plan.parts.images && flow.empty())
        return report_on(level, stage, rig, options.num_threads);
    SolverParameters p = solver_from_rig(rig);
    const SolverParameters held = solver_from_rig(anchor);
    ceres::Problem problem;
    const Rig sizes = level.rig_at(rig);
    const std::vector<double*> blocks = RigCost::blocks(p);
    const Moving moving = moving_parameters(stage, level.factor, plan, rig);
    const Parameters& free = moving.parameters;
    for (std::size_t i = 0; i < level.pairs.size() && plan.parts.images; ++i)
        problem.AddResidualBlock(
            new NecCost(*level.pairs[i], sizes, level.weights[i], share_limit, free), nullptr,
            blocks);
    for (const FlowTargets& targets : flow)
        problem.AddResidualBlock(new FlowCost(targets, options.flow_weight, free), nullptr, blocks);
    if (stage == 1 && options.prior_weight > 0) {
        const auto hold = [&](const double* from, int size, double delta, double* block) {
            problem.AddResidualBlock(
                new HoldCost(std::vector<double>(from, from + size)),
                new ceres::ScaledLoss(new ceres::HuberLoss(delta), options.prior_weight,
                                      ceres::TAKE_OWNERSHIP),
                block);
        };
        hold(held.translation, 3, 0.1, p.translation);
        hold(held.quaternion, 4, 0.05, p.quaternion);
    }
    if (moving.gauge) hold_gauge(problem, p, sizes.reference, options);
    freeze(problem, p, stage, options, moving);

    ceres::Solver::Options solver;
    solver.linear_solver_type = ceres::DENSE_QR;
    solver.max_num_iterations = options.max_iterations;
    solver.num_threads = resolve_threads(options.num_threads);
    solver.function_tolerance = tolerance;
    solver.parameter_tolerance = 1e-7;
    solver.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(solver, &problem, &summary);
    const double own = summary.total_time_in_seconds - summary.residual_evaluation_time_in_seconds -
                       summary.jacobian_evaluation_time_in_seconds;
    if (const auto& times = level.pairs[0]->times)
        times->solver += static_cast<std::int64_t>(1e9 * own);

    rig = rig_from_solver(p, rig);
    LevelReport report = report_on(level, stage, rig, options.num_threads);
    report.iterations = static_cast<int>(summary.iterations.size());
    report.initial_cost = summary.initial_cost;
    report.final_cost = summary.final_cost;
    report.stopped = summary.message;
    report.condition_number = condition_number(problem);
    report.seconds = seconds_now() - start;
    return report;
}

LevelReport solve_stage(const WorkingImages& images, const Level& level, int stage,
                        double share_limit, double tolerance, const Plan& plan, Rig& rig) {
    if (!plan.uses_flow)
        return solve_level(level, {}, stage, share_limit, tolerance, plan, rig, rig);
    // Coarse levels are too small for patches, and may have far to go.
    const bool coarse = level.factor >= kCoarse;
    const int factor = coarse ? kCoarse / 2 : level.factor;
    const int max_shift = coarse ? 48 : 24;
    constexpr double kSettled = 0.1;  // [working px]
    const double start = seconds_now();
    const Rig anchor = rig;
    LevelReport report;
    for (int round = 0; round < plan.options.flow_rounds; ++round) {
        const Rig from = rig;
        const std::vector<FlowTargets> flow =
            estimate_flow(images, factor, rig, plan.estimator, max_shift, plan.options.num_threads);
        const LevelReport before = report;
        report = solve_level(level, flow, stage, share_limit, tolerance, plan, anchor, rig);
        report.iterations += before.iterations;
        if (round > 0) report.initial_cost = before.initial_cost;
        if (median_distance(level, from, rig) < kSettled) break;
    }
    report.seconds = seconds_now() - start;
    return report;
}

double median_distance(const Level& level, const Rig& a, const Rig& b) {
    const Projector to_a(level.rig_at(a)), to_b(level.rig_at(b));
    const double scale = level.factor / level.rig_at(a).source_density().x();
    std::vector<double> distances;
    std::vector<float> ua(level.width), va(level.width), ub(level.width), vb(level.width);
    std::vector<std::uint8_t> ok_a(level.width), ok_b(level.width);
    for (const auto& pair : level.pairs)
        for (int y = 0; y < level.height; y += 8) {
            map_row(to_a, pair->depth().row(y), y, level.width, ua.data(), va.data(), ok_a.data());
            map_row(to_b, pair->depth().row(y), y, level.width, ub.data(), vb.data(), ok_b.data());
            for (int x = 0; x < level.width; x += 8)
                if ((ok_a[x] | ok_b[x]) == 0)
                    distances.push_back(scale * std::hypot(ua[x] - ub[x], va[x] - vb[x]));
        }
    if (distances.empty()) return INFINITY;
    std::nth_element(distances.begin(), distances.begin() + distances.size() / 2, distances.end());
    return distances[distances.size() / 2];
}

}  // namespace xcalib

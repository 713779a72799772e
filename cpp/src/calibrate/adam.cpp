#include "calibrate/adam.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "base/format.hpp"
#include "base/parallel.hpp"
#include "objective/paper_variables.hpp"
#include "solve/flow_term.hpp"
#include "solve/solve.hpp"

namespace xcalib {
namespace {

constexpr int kFlowFactor = 2, kFlowShift = 24;  // [px of that level]

// A loss and its gradient by the paper's variables.
struct Loss {
    double value = 0.0;
    PaperVector gradient = PaperVector::Zero();
};

// Eq. (huber) of the length of x - x0, and its gradient by x.
template <class Vector>
double huber(const Vector& x, const Vector& x0, double delta, Vector& gradient) {
    const Vector difference = x - x0;
    const double length = difference.norm();
    if (length <= delta) {
        gradient = difference;
        return 0.5 * length * length;
    }
    gradient = delta / length * difference;
    return delta * (length - 0.5 * delta);
}

// Eq. (camera_regularization).
Loss prior_loss(const PaperParameters& p, const Rig& rig, const Rig& held) {
    Loss loss;
    Eigen::Vector3d by_t;
    loss.value = huber<Eigen::Vector3d>(rig.t(), held.t(), 0.1, by_t);
    for (int scale = 0; scale < 3; ++scale)
        loss.gradient.segment<3>(kPaperTranslation + 3 * scale) =
            std::pow(kPaperTranslationScale, scale) * by_t;
    const auto wxyz = [](const Rig& r) {
        const Eigen::Quaterniond& q = r.source_from_reference.rotation;
        return Eigen::Vector4d(q.w(), q.x(), q.y(), q.z());
    };
    const Eigen::Vector4d q = wxyz(rig);
    Eigen::Vector4d q0 = wxyz(held), by_q;
    if (q.dot(q0) < 0) q0 = -q0;  // the same rotation
    loss.value += huber<Eigen::Vector4d>(q, q0, 0.05, by_q);
    loss.gradient.segment<4>(kPaperQuaternion) = (by_q - q * q.dot(by_q)) / p.quaternion.norm();
    return loss;
}

// What stage 1 freezes, what is known, and scales that are not used.
std::vector<bool> frozen(int stage, const Plan& plan) {
    const CalibrationOptions& options = plan.options;
    std::vector<bool> held(kNumPaperVariables, false);
    for (const int first : {kPaperReference, kPaperSource}) {
        const bool known = first == kPaperSource ? options.source_camera.has_value()
                                                 : options.reference_camera.has_value();
        for (int i = 0; i < 5; ++i) held[first + i] = known || (stage == 1 && i >= 2);
    }
    held[kPaperQuaternion + 3] = stage == 1;  // roll
    for (int scale = 0; scale < 3; ++scale)
        for (int axis = 0; axis < 3; ++axis)
            held[kPaperTranslation + 3 * scale + axis] =
                scale >= options.adam.translation_scales || (stage == 1 && axis == 2);
    for (int i = 0; i < 2; ++i) held[kPaperLens + i] = stage == 1 || i >= plan.lens_coefficients;
    return held;
}

// The moments of one variable are those of the steps in which it was free.
class Adam {
   public:
    void step(PaperVector& x, const PaperVector& gradient, const std::vector<bool>& held,
              double rate) {
        constexpr double kFirst = 0.9, kSecond = 0.999, kEpsilon = 1e-8;
        for (int i = 0; i < kNumPaperVariables; ++i) {
            if (held[i]) continue;
            ++steps_[i];
            first_[i] = kFirst * first_[i] + (1 - kFirst) * gradient[i];
            second_[i] = kSecond * second_[i] + (1 - kSecond) * gradient[i] * gradient[i];
            const double mean = first_[i] / (1 - std::pow(kFirst, steps_[i]));
            const double square = second_[i] / (1 - std::pow(kSecond, steps_[i]));
            x[i] -= rate * mean / (std::sqrt(square) + kEpsilon);
        }
    }

   private:
    PaperVector first_ = PaperVector::Zero(), second_ = PaperVector::Zero();
    Eigen::Matrix<int, kNumPaperVariables, 1> steps_ =
        Eigen::Matrix<int, kNumPaperVariables, 1>::Zero();
};

// Eq. (image_loss) and the flow term of a batch, with the gradient by `Parameter`.
struct BatchLoss {
    double image = 0.0, flow = 0.0;
    Eigen::VectorXd image_gradient = Eigen::VectorXd::Zero(kNumParameters);
    Eigen::VectorXd flow_gradient = Eigen::VectorXd::Zero(kNumParameters);
};

BatchLoss batch_loss(const WorkingImages& images, const Level& level,
                     const std::vector<std::size_t>& batch, const Plan& plan, const Rig& rig) {
    const int num_threads = plan.options.num_threads;
    BatchLoss loss;
    const Rig at_level = level.rig_at(rig);
    std::vector<NecNormalEquations> equations(batch.size());
    parallel_each(static_cast<int>(batch.size()), num_threads, [&](int i) {
        equations[i] =
            level.pairs[batch[i]]->normal_equations(at_level, Parameters(kNumParameters));
    });
    double weights = 0;
    for (const std::size_t i : batch) weights += level.weights[i];
    if (!(weights > 0)) loss.image = 1;  // nothing overlaps
    for (std::size_t i = 0; i < batch.size(); ++i) {
        const double weight = weights > 0 ? level.weights[batch[i]] / weights : 0.0;
        loss.image += weight * (1 - equations[i].value.nec);
        loss.image_gradient += weight * equations[i].gradient;
    }
    if (!plan.uses_flow) return loss;
    const std::vector<FlowTargets> flow = estimate_flow(images.subset(batch), kFlowFactor, rig,
                                                        plan.estimator, kFlowShift, num_threads);
    for (const FlowTargets& targets : flow) {
        const FlowEquations terms =
            flow_equations(targets, targets.rig, Parameters(kNumParameters));
        loss.flow += terms.value;
        loss.flow_gradient += terms.gradient;
    }
    return loss;
}

// The indices 0..count-1 in an order drawn from `generator`.
std::vector<std::size_t> shuffled(std::size_t count, std::mt19937& generator) {
    std::vector<std::size_t> order(count);
    std::iota(order.begin(), order.end(), std::size_t{0});
    for (std::size_t i = count; i > 1; --i) std::swap(order[i - 1], order[generator() % i]);
    return order;
}

}  // namespace

void solve_adam(const WorkingImages& images, const Plan& plan,
                const std::function<void(double)>& progress, Rig& rig, CalibrationReport& report) {
    const CalibrationOptions& options = plan.options;
    const AdamOptions& schedule = options.adam;
    const Rig held = rig;
    const std::size_t batch_size = std::min<std::size_t>(schedule.batch, images.size());
    const std::size_t per_epoch = (images.size() + batch_size - 1) / batch_size;
    const std::size_t count = per_epoch * schedule.epochs;
    const auto fine_from = static_cast<std::size_t>(schedule.fine_from * count);
    PaperVector x = vector_of(paper_from_rig(rig));
    std::mt19937 generator(options.seed);
    Adam adam;
    std::vector<std::size_t> order;
    Level level;
    double began = seconds_now();
    for (std::size_t step = 0; step < count; ++step) {
        const std::size_t first = step % per_epoch * batch_size;
        if (first == 0) {  // an epoch: the weights c_i and the clamps are those of here
            order = shuffled(images.size(), generator);
            level = make_nec_level(images, 1, rig, options.num_threads);
        }
        const std::vector<std::size_t> batch(
            order.begin() + first, order.begin() + std::min(first + batch_size, order.size()));
        const int stage = step < fine_from ? 1 : 2;
        const PaperParameters paper = paper_of(x);
        const BatchLoss loss = batch_loss(images, level, batch, plan, rig);
        const Loss prior = prior_loss(paper, rig, held);
        const double gamma = stage == 1 ? options.prior_weight : 0.0;
        AdamStep taken;
        taken.learning_rate =
            (stage == 1 ? schedule.learning_rate : schedule.fine_learning_rate) *
            std::pow(schedule.decay, static_cast<double>(stage == 1 ? step : step - fine_from));
        taken.image = loss.image;
        taken.flow = loss.flow;
        taken.prior = prior.value;
        taken.total = loss.image + options.flow_weight * loss.flow + gamma * prior.value;
        report.steps.push_back(taken);
        const PaperVector gradient =
            paper_jacobian(paper, rig).transpose() *
                (loss.image_gradient + options.flow_weight * loss.flow_gradient) +
            gamma * prior.gradient;
        adam.step(x, gradient, frozen(stage, plan), taken.learning_rate);
        rig = rig_from_paper(paper_of(x), rig);
        progress(static_cast<double>(step + 1) / static_cast<double>(count));

        if (step + 1 != fine_from && step + 1 != count) continue;
        const std::size_t from = stage == 1 ? 0 : fine_from;
        LevelReport entry = report_on(level, stage, rig, options.num_threads);
        entry.iterations = static_cast<int>(step + 1 - from);
        entry.initial_cost = report.steps[from].total;
        entry.final_cost = taken.total;
        entry.seconds = seconds_now() - began;
        entry.stopped = format("the schedule ended after %zu steps", step + 1);
        report.levels.push_back(entry);
        began = seconds_now();
    }
}

}  // namespace xcalib

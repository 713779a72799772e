#include "xcalib/calibration_options.hpp"

#include <cmath>
#include <locale>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "xcalib/error.hpp"
#include "xcalib/parameters.hpp"
#include "xcalib/threads.hpp"

namespace xcalib {
namespace {

void require(bool ok, const char* field, double value, const char* expected) {
    if (ok) return;
    std::ostringstream message;
    message << "options: " << field << " = " << value << ", expected " << expected;
    throw std::invalid_argument(message.str());
}

}  // namespace

void SearchOptions::validate() const {
    require(max_fov_ratio > 1 && max_fov_ratio <= 10, "search.max_fov_ratio", max_fov_ratio,
            "a ratio in (1, 10]");
    require(max_roll_deg >= 0 && max_roll_deg <= 180, "search.max_roll_deg", max_roll_deg,
            "an angle in [0, 180] deg");
    require(min_overlap > 0 && min_overlap < 1, "search.min_overlap", min_overlap,
            "a share in (0, 1)");
    require(map_width >= 32, "search.map_width", map_width, "at least 32 px");
    require(candidates >= 1, "search.candidates", candidates, "at least 1");
}

void AdamOptions::validate() const {
    require(epochs >= 1, "adam.epochs", epochs, "at least 1");
    require(batch >= 1, "adam.batch", batch, "at least 1");
    require(learning_rate > 0 && std::isfinite(learning_rate), "adam.learning_rate", learning_rate,
            "a finite number > 0");
    require(fine_learning_rate > 0 && std::isfinite(fine_learning_rate), "adam.fine_learning_rate",
            fine_learning_rate, "a finite number > 0");
    require(decay > 0 && decay <= 1, "adam.decay", decay, "a factor in (0, 1]");
    require(fine_from >= 0 && fine_from <= 1, "adam.fine_from", fine_from, "a share in [0, 1]");
    require(translation_scales >= 1 && translation_scales <= 3, "adam.translation_scales",
            translation_scales, "1 to 3");
}

Tolerance Tolerance::parse(const std::string& option, const std::string& text) {
    constexpr double kWider = 2.5;
    std::vector<double> values;
    std::istringstream parts(text + ",");
    parts.imbue(std::locale::classic());
    double value = 0;
    char comma = 0;
    while (parts >> value >> comma && comma == ',' && value > 0) values.push_back(value);
    parts.clear();
    const bool whole = parts.peek() == std::istringstream::traits_type::eof();
    if (!whole || values.empty() || values.size() > 2)
        throw InputError(option + " is '" + text +
                         "', expected MEDIAN or MEDIAN,P95: pixels above 0, as 2,5");
    return {values[0], values.size() > 1 ? values[1] : kWider * values[0]};
}

void CalibrationOptions::validate() const {
    require(max_frames >= 1, "max_frames", max_frames, "at least 1");
    require(num_threads >= 0 && num_threads <= kMaxThreads, "num_threads", num_threads,
            "0 (every core) to 1024");
    require(working_width >= 64, "working_width", working_width, "at least 64 px");
    require(max_iterations >= 1, "max_iterations", max_iterations, "at least 1");
    require(std::isfinite(prior_weight) && prior_weight >= 0, "prior_weight", prior_weight,
            "a finite number >= 0");
    require(std::isfinite(flow_weight) && flow_weight > 0, "flow_weight", flow_weight,
            "a finite number > 0");
    require(flow_rounds >= 1, "flow_rounds", flow_rounds, "at least 1");
    if (reference_hfov_deg)
        require(*reference_hfov_deg > 0 && *reference_hfov_deg < 180, "reference_hfov_deg",
                *reference_hfov_deg, "an angle in (0, 180) deg");
    if (reference_camera) reference_camera->validate("options: reference_camera");
    if (source_camera) source_camera->validate("options: source_camera");
    if (reference_lens) reference_lens->validate("options: reference_lens");
    if (source_lens) source_lens->validate("options: source_lens");
    if (optimize_lens && source_camera)
        throw std::invalid_argument(
            "options: optimize_lens beside source_camera, which is kept, expected one of them");
    if (optimize_lens && source_lens && !has_lens_parameters(*source_lens))
        throw std::invalid_argument(
            "options: optimize_lens with source_lens = " + Lens::word(source_lens) +
            ", expected brown of 4 or 5 coefficients, or none given");
    search.validate();
    require(tolerance.median > 0, "tolerance.median", tolerance.median, "more than 0 px");
    require(tolerance.p95 > 0, "tolerance.p95", tolerance.p95, "more than 0 px");
    if (relative_depth) relative_depth->validate("options: relative_depth");
    if (solver != Solver::adam) return;
    if (search.mode == SearchMode::full || search.mode == SearchMode::local)
        throw std::invalid_argument(
            "options: solver = adam searches nothing, expected search.mode = automatic or off");
    adam.validate();
}

}  // namespace xcalib

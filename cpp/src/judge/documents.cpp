#include "xcalib/judge/documents.hpp"

#include <cmath>

#include "judge/json.hpp"
#include "xcalib/calibrate.hpp"
#include "xcalib/judge/describe.hpp"

namespace xcalib {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180;

Json json_of(const CandidateReport& c) {
    return {{"score", c.score},
            {"correlation", c.correlation},
            {"overlap", c.overlap},
            {"refined_nec", c.refined_nec},
            {"reference_hfov_deg", c.refined.reference.hfov() / kDegree},
            {"source_hfov_deg", c.refined.source.hfov() / kDegree}};
}

Json json_of(const LevelReport& l) {
    return {{"factor", l.factor},
            {"stage", l.stage},
            {"width", l.width},
            {"height", l.height},
            {"iterations", l.iterations},
            {"initial_cost", l.initial_cost},
            {"final_cost", l.final_cost},
            {"nec", l.nec},
            {"aligned", l.aligned},
            {"valid_share", l.valid_share},
            {"condition_number", l.condition_number},
            {"seconds", l.seconds},
            {"stopped", l.stopped}};
}

Json json_of(const LensReport& l) {
    return {{"tried", l.tried},
            {"coefficients", l.coefficients},
            {"gain", l.gain},
            {"gain_deviation", l.gain_deviation}};
}

Json json_of(const AdamStep& s) {
    return {{"learning_rate", s.learning_rate},
            {"image", s.image},
            {"flow", s.flow},
            {"prior", s.prior},
            {"total", s.total}};
}

Json json_of(const CalibrationTimes& t) {
    return {{"prepare", t.prepare}, {"search", t.search},     {"warp", t.warp},
            {"value", t.value},     {"jacobian", t.jacobian}, {"solver", t.solver}};
}

Json json_of(const Pinhole& camera) {
    Json out{{"width", camera.width},
             {"height", camera.height},
             {"fx", camera.fx},
             {"fy", camera.fy},
             {"cx", camera.cx},
             {"cy", camera.cy},
             {"skew", camera.skew},
             {"hfov_deg", camera.hfov() / kDegree},
             {"vfov_deg", camera.vfov() / kDegree}};
    if (camera.lens.model() != LensModel::none)
        out["lens"] = {{"model", name_of(camera.lens.model())},
                       {"coefficients", camera.lens.coefficients()}};
    return out;
}

Json json_of(const ExpectedError& error) { return {{"median", error.median}, {"p95", error.p95}}; }

Json json_of(const ErrorAtDepth& row) {
    return {{"depth_m", row.depth}, {"median", row.error.median}, {"p95", row.error.p95}};
}

template <class Value>
Json list_of(const std::vector<Value>& values) {
    Json list = Json::array();
    for (const Value& value : values) list.push_back(json_of(value));
    return list;
}

template <class Vector>
Json numbers_of(const Vector& values) {
    Json list = Json::array();
    for (const double value : values) list.push_back(value);
    return list;
}

Json json_of(const LagReport& lag) {
    if (lag.fits.empty()) return nullptr;
    Json fits = Json::array();
    for (const LagFit& fit : lag.fits) {
        const RigFacts facts = describe(fit.rig);
        fits.push_back({{"lag", fit.lag},
                        {"frames", fit.frames},
                        {"factor", fit.factor},
                        {"nec", fit.nec},
                        {"gain", fit.gain},
                        {"error", fit.error},
                        {"translation_m", numbers_of(fit.rig.t())},
                        {"pan_deg", facts.pan_deg},
                        {"tilt_deg", facts.tilt_deg},
                        {"skew_px", fit.rig.source.skew}});
    }
    return {{"frames", lag.frames}, {"change", lag.change}, {"fits", fits}};
}

// Maps over the reference image at depths from the near to the far end of the footage's, in equal
// steps of inverse depth; null where no error is expected of any depth.
Json error_maps(const CalibrationReport& report) {
    constexpr int kDepths = 6, kWidth = 20, kHeight = 15;
    if (!report.errors || report.verdict.by_depth.empty() || !(report.near_m > 0)) return nullptr;
    Json depths = Json::array(), maps = Json::array();
    for (int i = 0; i < kDepths; ++i) {
        const double far = i / (kDepths - 1.0);
        const double depth = 1 / ((1 - far) / report.near_m + far / report.far_m);
        depths.push_back(depth);
        Json map = Json::array();
        for (const float error : expected_error_map(report, depth, kWidth, kHeight).pixels)
            map.push_back(std::round(1000.0 * error) / 1000);
        maps.push_back(map);
    }
    return {{"depths_m", depths}, {"width", kWidth}, {"height", kHeight}, {"median_px", maps}};
}

Json json_of(const RunFacts& run) {
    Json choice = Json::array();
    for (const RunFacts::Frame& frame : run.choice)
        choice.push_back({{"file", frame.file}, {"taken", frame.taken}, {"reason", frame.reason}});
    return {{"program", run.program},
            {"arguments", run.arguments},
            {"directory", run.directory},
            {"lag", run.lag},
            {"choice", choice}};
}

std::string text_of(const Json& document) {
    return document.dump(2, ' ', true, Json::error_handler_t::replace);
}

Json json_of(const Verdict& verdict) {
    return {{"trusted", verdict.trusted},
            {"found", verdict.found},
            {"reason", verdict.reason},
            {"advice", verdict.advice},
            {"expected_error_px", json_of(verdict.expected_error)},
            {"error_by_depth", list_of(verdict.by_depth)},
            {"frames", verdict.frames},
            {"date", verdict.date},
            {"software", verdict.software}};
}

}  // namespace

Json json_of(const CalibrationReport& report) {
    return {{"verdict", json_of(report.verdict)},
            {"converged", report.converged},
            {"message", report.message},
            {"seconds", report.seconds},
            {"time", json_of(report.time)},
            {"working_width", report.working_width},
            {"working_height", report.working_height},
            {"nec", report.nec},
            {"baseline_nec", report.baseline_nec},
            {"contrast", report.contrast},
            {"repeatability_px", report.repeatability_px},
            {"visible_shift_px", report.visible_shift_px},
            {"valid_share", report.valid_share},
            {"near_m", report.near_m},
            {"middle_m", report.middle_m},
            {"far_m", report.far_m},
            {"weak_directions", report.weak_directions},
            {"frames", report.frames},
            {"candidates", list_of(report.candidates)},
            {"levels", list_of(report.levels)},
            {"lens", json_of(report.lens)},
            {"steps", list_of(report.steps)},
            {"lag", json_of(report.lag)}};
}

Json json_of(const Scores& scores) {
    Json out = Json::object();
    for (std::size_t i = 0; i < scores.size(); ++i) out[kScoreNames[i]] = scores[i];
    return out;
}

Json json_of(const Evaluation& evaluation) {
    Scores gains;
    for (std::size_t i = 0; i < gains.size(); ++i) gains[i] = evaluation.gain(i);
    Json frames = Json::array();
    for (const auto& [registered, unregistered] : evaluation.frames)
        frames.push_back(
            {{"registered", json_of(registered)}, {"unregistered", json_of(unregistered)}});
    Json out{{"size", Json::array({evaluation.width, evaluation.height})},
             {"valid_share", evaluation.valid_share},
             {"registered", json_of(evaluation.registered)},
             {"unregistered", json_of(evaluation.unregistered)},
             {"gain_percent", json_of(gains)}};
    if (evaluation.given) {
        out["given"] = json_of(*evaluation.given);
        for (std::size_t i = 0; i < frames.size(); ++i)
            frames[i]["given"] = json_of(evaluation.given_frames[i]);
    }
    out["frames"] = frames;
    out["verdict"] = evaluation.verdict ? json_of(*evaluation.verdict) : Json();
    return out;
}

Json json_of(const Rig& rig) {
    const RigFacts facts = describe(rig);
    Json centre = Json::array();
    for (const RigFacts::Centre& row : facts.centre)
        centre.push_back({{"depth_m", row.depth ? Json(*row.depth) : Json(nullptr)},
                          {"point_px", numbers_of(row.point)},
                          {"parallax_px", row.parallax}});
    const Eigen::Quaterniond& q = rig.source_from_reference.rotation;
    return {{"reference", json_of(rig.reference)},
            {"source", json_of(rig.source)},
            {"rotation_deg",
             {{"pan", facts.pan_deg}, {"tilt", facts.tilt_deg}, {"roll", facts.roll_deg}}},
            {"quaternion_wxyz", Json::array({q.w(), q.x(), q.y(), q.z()})},
            {"translation_m", numbers_of(rig.t())},
            {"position_m", numbers_of(facts.position)},
            {"baseline_m", facts.baseline},
            {"centre", centre},
            {"verdict", rig.verdict ? json_of(*rig.verdict) : Json()}};
}

std::string report_document(const CalibrationReport& report, const std::string& rig_file,
                            const std::vector<std::string>& files, const RunFacts& run) {
    Json document{{"format", "xcalib-report"},
                  {"version", 1},
                  {"rig", rig_file},
                  {"files", files},
                  {"run", json_of(run)}};
    document.update(json_of(report));
    document["expected_error_map"] = error_maps(report);
    return text_of(document) + "\n";
}

std::string evaluation_document(const Evaluation& evaluation, const std::string& rig_file,
                                const std::vector<std::string>& files) {
    Json document{{"rig", rig_file}, {"files", files}};
    document.update(json_of(evaluation));
    return text_of(document) + "\n";
}

std::string rig_document(const Rig& rig) { return text_of(json_of(rig)); }

}  // namespace xcalib

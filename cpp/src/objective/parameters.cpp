#include "xcalib/parameters.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace xcalib {
namespace {

constexpr double kPi = 3.14159265358979323846;

// arctan of half the vertical opening at the paper's 45 deg horizontal start.
double paper_half_vfov(int width, int height) {
    return std::atan(static_cast<double>(height) / width * std::tan(kPi / 8));
}

Pinhole pinhole_from_paper(const PaperParameters::Camera& p, const Pinhole& rest) {
    Pinhole camera = rest;
    const int width = rest.width, height = rest.height;
    camera.fx = width / (2 * std::tan(p.fx * kPi / 8));
    camera.fy = height / (2 * std::tan(p.fy * paper_half_vfov(width, height)));
    camera.cx = p.cx * width - 0.5;
    camera.cy = p.cy * height - 0.5;
    camera.skew = p.skew;
    return camera;
}

PaperParameters::Camera paper_from_pinhole(const Pinhole& camera) {
    PaperParameters::Camera p;
    p.fx = std::atan(camera.width / (2 * camera.fx)) / (kPi / 8);
    p.fy =
        std::atan(camera.height / (2 * camera.fy)) / paper_half_vfov(camera.width, camera.height);
    p.cx = (camera.cx + 0.5) / camera.width;
    p.cy = (camera.cy + 0.5) / camera.height;
    p.skew = camera.skew;
    return p;
}

Pinhole pinhole_from_solver(const SolverParameters::Camera& p, const Pinhole& rest) {
    Pinhole camera = rest;
    const int width = rest.width, height = rest.height;
    camera.fx = std::exp(p.log_f[0]) * width;
    camera.fy = std::exp(p.log_f[1]) * height;
    camera.cx = p.center[0] * width - 0.5;
    camera.cy = p.center[1] * height - 0.5;
    camera.skew = p.skew_share[0] * width;
    return camera;
}

SolverParameters::Camera solver_from_pinhole(const Pinhole& camera) {
    return {{std::log(camera.fx / camera.width), std::log(camera.fy / camera.height)},
            {(camera.cx + 0.5) / camera.width, (camera.cy + 0.5) / camera.height},
            {camera.skew / camera.width}};
}

// k1 and k2, and the lens that has these instead; what is none stays none where they are 0.
void read_lens(const Lens& lens, double (&k)[2]) {
    for (int i = 0; i < 2; ++i) k[i] = has_lens_parameters(lens) ? lens.coefficient(i) : 0.0;
}
Lens lens_with(const Lens& rest, const double (&k)[2]) {
    if (!has_lens_parameters(rest) || (!rest.bends() && k[0] == 0 && k[1] == 0)) return rest;
    std::vector<double> coefficients = rest.coefficients();
    coefficients.resize(std::max<std::size_t>(coefficients.size(), 4));
    std::copy_n(k, 2, coefficients.begin());
    return {LensModel::brown, coefficients};
}

}  // namespace

bool has_lens_parameters(const Lens& lens) {
    return lens.model() == LensModel::none ||
           (lens.model() == LensModel::brown && !lens.is_rational());
}

Rig rig_from_paper(const PaperParameters& parameters, const Rig& rest) {
    const Eigen::Vector4d q = parameters.quaternion.normalized();
    Rig rig = rest;
    rig.reference = pinhole_from_paper(parameters.reference, rest.reference);
    rig.source = pinhole_from_paper(parameters.source, rest.source);
    rig.source_from_reference.rotation = Eigen::Quaterniond(q[0], q[1], q[2], q[3]);
    constexpr double kScale = kPaperTranslationScale;
    rig.source_from_reference.translation =
        parameters.translation * Eigen::Vector3d(1, kScale, kScale * kScale);
    rig.source.lens = lens_with(rest.source.lens, parameters.source_lens);
    return rig;
}

PaperParameters paper_from_rig(const Rig& rig) {
    const Eigen::Quaterniond& q = rig.source_from_reference.rotation;
    PaperParameters parameters;
    parameters.reference = paper_from_pinhole(rig.reference);
    parameters.source = paper_from_pinhole(rig.source);
    parameters.quaternion = {q.w(), q.x(), q.y(), q.z()};
    parameters.translation.col(0) = rig.t();
    read_lens(rig.source.lens, parameters.source_lens);
    return parameters;
}

SolverParameters solver_from_rig(const Rig& rig) {
    const Eigen::Quaterniond& q = rig.source_from_reference.rotation;
    SolverParameters parameters{solver_from_pinhole(rig.reference),
                                solver_from_pinhole(rig.source),
                                {q.w(), q.x(), q.y(), q.z()},
                                {rig.t().x(), rig.t().y(), rig.t().z()},
                                {0, 0}};
    read_lens(rig.source.lens, parameters.source_lens);
    return parameters;
}

Rig rig_from_solver(const SolverParameters& parameters, const Rig& rest) {
    const double* q = parameters.quaternion;
    const double* t = parameters.translation;
    Rig rig = rest;
    rig.reference = pinhole_from_solver(parameters.reference, rest.reference);
    rig.source = pinhole_from_solver(parameters.source, rest.source);
    rig.source_from_reference.rotation = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized();
    rig.source_from_reference.translation = Eigen::Vector3d(t[0], t[1], t[2]);
    rig.source.lens = lens_with(rest.source.lens, parameters.source_lens);
    return rig;
}

}  // namespace xcalib

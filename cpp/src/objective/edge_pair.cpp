#include <cmath>
#include <vector>

#include "base/kernel_targets.hpp"
#include "objective/image_pair.hpp"
#include "objective/nec_pass.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "objective/edge_pair.cpp"
#include <hwy/foreach_target.h>
// After it.
#include "objective/pass-inl.hpp"

#ifndef XCALIB_EDGE_PAIR_ONCE
#define XCALIB_EDGE_PAIR_ONCE
namespace xcalib {
namespace {

// One pass over a pair. A source rolled by phi shows every direction turned by it, z by twice that:
// `turn` is exp(-2 i phi).
struct EdgePass {
    const EdgeMap &reference, &source;
    const Image& depth;
    Projector projector;
    ProjectionDerivative derivative;
    const Parameters& parameters;
    float turn_real, turn_imaginary;
    PointRow points;
    std::vector<float> u, v;
    struct Component {
        std::vector<float> value, du, dv, derivative;
        Component(int room, int count)
            : value(room), du(room), dv(room), derivative(room * count) {}
    } real, imaginary;
    std::vector<std::uint8_t> validity;

    EdgePass(const EdgeMap& reference, const EdgeMap& source, const Image& depth, const Rig& rig,
             const Parameters& parameters)
        : reference(reference), source(source), depth(depth), projector(rig), derivative(rig),
          parameters(parameters), points(parameters.size() > 0 ? depth.width : 0),
          u(depth.width + kRoom, NAN), v(depth.width + kRoom, NAN),
          real(depth.width + kRoom, parameters.size()),
          imaginary(depth.width + kRoom, parameters.size()), validity(depth.width) {
        const Eigen::Matrix3d R = rig.R();
        const double roll = std::atan2(R(1, 0), R(0, 0));
        turn_real = static_cast<float>(std::cos(2 * roll));
        turn_imaginary = static_cast<float>(-std::sin(2 * roll));
    }
};

struct EdgeSums {
    double rr = 0, ss = 0, rs = 0;
};

}  // namespace
}  // namespace xcalib
#endif

HWY_BEFORE_NAMESPACE();
namespace xcalib {
namespace HWY_NAMESPACE {
namespace {

struct ComplexSample {
    Sampled real, imaginary;
};
HWY_INLINE ComplexSample sample(const EdgePass& pass, const Cell& cell) {
    // Real and imaginary parts in turn.
    const float* HWY_RESTRICT z = reinterpret_cast<const float*>(pass.source.z.data());
    const Int top = hn::ShiftLeft<1>(cell.top), bottom = hn::ShiftLeft<1>(cell.bottom);
    const Pair t0 = gather_pairs(z, top), t1 = gather_pairs(z + 2, top);
    const Pair b0 = gather_pairs(z, bottom), b1 = gather_pairs(z + 2, bottom);
    return {interpolated(cell, t0.first, t1.first, b0.first, b1.first),
            interpolated(cell, t0.second, t1.second, b0.second, b1.second)};
}

// The source's edges of a row in `real` and `imaginary`, 0 where it is not valid, and its sums.
EdgeSums warp_edge_row(EdgePass& pass, int y) {
    const FloatTag d;
    const int width = pass.depth.width;
    map_row(pass.projector, pass.depth.row(y), y, width, pass.u.data(), pass.v.data(),
            pass.validity.data());
    const Float turn_real = hn::Set(d, pass.turn_real);
    const Float turn_imaginary = hn::Set(d, pass.turn_imaginary);
    const float* HWY_RESTRICT reference = reinterpret_cast<const float*>(pass.reference.row(y));
    Float rr = hn::Zero(d), ss = rr, rs = rr;
    for (int x = 0; x < width; x += lanes()) {
        const Float u = load(pass.u.data() + x);
        const Mask ok = hn::Eq(u, u);
        const Cell cell =
            cell_at(hn::IfThenElseZero(ok, u), hn::IfThenElseZero(ok, load(pass.v.data() + x)),
                    pass.source.width, pass.source.height);
        const ComplexSample z = sample(pass, cell);
        const auto put_turned = [&](Float real, Float imaginary, std::vector<float>& out_real,
                                    std::vector<float>& out_imaginary) HWY_ATTR {
            const Float re = hn::Sub(hn::Mul(real, turn_real), hn::Mul(imaginary, turn_imaginary));
            const Float im = hn::MulAdd(real, turn_imaginary, hn::Mul(imaginary, turn_real));
            hn::StoreU(hn::IfThenElseZero(ok, re), d, out_real.data() + x);
            hn::StoreU(hn::IfThenElseZero(ok, im), d, out_imaginary.data() + x);
        };
        put_turned(z.real.value, z.imaginary.value, pass.real.value, pass.imaginary.value);
        Float r_real, r_imaginary;  // with room past the end
        hn::LoadInterleaved2(d, reference + 2 * x, r_real, r_imaginary);
        r_real = hn::IfThenElseZero(ok, r_real);
        r_imaginary = hn::IfThenElseZero(ok, r_imaginary);
        const Float s_real = load(pass.real.value.data() + x);
        const Float s_imaginary = load(pass.imaginary.value.data() + x);
        rr = hn::Add(rr, hn::MulAdd(r_real, r_real, hn::Mul(r_imaginary, r_imaginary)));
        ss = hn::Add(ss, hn::MulAdd(s_real, s_real, hn::Mul(s_imaginary, s_imaginary)));
        rs = hn::Add(rs, hn::MulAdd(r_real, s_real, hn::Mul(r_imaginary, s_imaginary)));
        if (pass.parameters.size() == 0) continue;
        put_turned(z.real.du, z.imaginary.du, pass.real.du, pass.imaginary.du);
        put_turned(z.real.dv, z.imaginary.dv, pass.real.dv, pass.imaginary.dv);
    }
    return {total(rr), total(ss), total(rs)};
}

// Appends the row that was warped last.
void append_edge_row(EdgePass& pass, int y, PassTile& tile) {
    const FloatTag d;
    const int width = pass.depth.width, stride = width + kRoom;
    const float* depth = pass.depth.row(y);
    seen_row(pass.projector, depth, y, width, pass.points);
    for (EdgePass::Component* part : {&pass.real, &pass.imaginary})
        derivative_row(pass.derivative, pass.parameters, depth, part->du.data(), part->dv.data(),
                       width, pass.points, part->derivative.data(), stride);
    for (int i = 0; i < tile.count; ++i) {
        if (pass.parameters[i] != kRotationZ) continue;
        for (int x = 0; x < width; ++x) {  // of exp(-2 i phi)
            pass.real.derivative[i * stride + x] += 2 * pass.imaginary.value[x];
            pass.imaginary.derivative[i * stride + x] -= 2 * pass.real.value[x];
        }
    }
    const float* reference = reinterpret_cast<const float*>(pass.reference.row(y));
    for (int x = 0; x < width; x += lanes()) {
        const Float u = load(pass.u.data() + x);
        const Mask ok = hn::Eq(u, u);
        if (hn::AllFalse(d, ok)) continue;
        for (int p = 0; p < tile.count; ++p)
            put(tile, p, ok, load(pass.real.derivative.data() + p * stride + x),
                load(pass.imaginary.derivative.data() + p * stride + x));
        put(tile, tile.count, ok, load(pass.real.value.data() + x),
            load(pass.imaginary.value.data() + x));
        Float real, imaginary;
        hn::LoadInterleaved2(d, reference + 2 * x, real, imaginary);
        put(tile, tile.count + 1, ok, real, imaginary);
        finish(tile, ok);
    }
}

void flush_edge_tile(PassTile& tile) { flush(tile); }

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace xcalib
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace xcalib {
namespace {

HWY_EXPORT(warp_edge_row);
HWY_EXPORT(append_edge_row);
HWY_EXPORT(flush_edge_tile);

NecValue value_of(const EdgeSums& sums, double reference_energy) {
    NecValue value;
    value.norm = std::sqrt(sums.rr * sums.ss);
    value.nec = value.aligned = value.norm > 0 ? sums.rs / value.norm : 0.0;
    value.valid_share = reference_energy > 0 ? sums.rr / reference_energy : 0.0;
    return value;
}

// Calls work(y) for each row once it is warped, and gives the sums.
template <class Work>
EdgeSums for_each_warped_row(EdgePass& pass, WorkTimes* times, const Work& work) {
    PassClock clock(times, pass.parameters.size() > 0);
    EdgeSums sums;
    for (int y = 0; y < pass.depth.height; ++y) {
        const EdgeSums row =
            clock.warp([&] { return HWY_DYNAMIC_DISPATCH(warp_edge_row)(pass, y); });
        sums.rr += row.rr;
        sums.ss += row.ss;
        sums.rs += row.rs;
        work(y);
    }
    return sums;
}

}  // namespace

EdgePair::EdgePair(EdgeMap reference, EdgeMap source, Image depth)
    : reference_(std::move(reference)), source_(std::move(source)) {
    set_depth(std::move(depth));
    reference_.z.reserve(reference_.z.size() + kRoom);  // exactly: to grow would double it
    reference_.z.resize(reference_.z.size() + kRoom);   // the last row is read beyond its end
}

void EdgePair::set_depth(Image depth) {
    depth_ = std::move(depth);
    reference_energy_ = 0.0;
    for (std::size_t i = 0; i < depth_.pixels.size(); ++i) {
        if (depth_.pixels[i] <= 0) reference_.z[i] = 0;
        reference_energy_ += std::norm(reference_.z[i]);
    }
}

std::shared_ptr<const ImagePair> EdgePair::with_depth(Image depth) const {
    auto out = std::make_shared<EdgePair>(*this);
    out->set_depth(std::move(depth));
    return out;
}

NecValue EdgePair::evaluate(const Rig& rig) const {
    const Parameters none(0);
    EdgePass pass(reference_, source_, depth_, rig, none);
    return value_of(for_each_warped_row(pass, times.get(), [](int) {}), reference_energy_);
}

NecNormalEquations EdgePair::normal_equations(const Rig& rig, const Parameters& parameters) const {
    EdgePass pass(reference_, source_, depth_, rig, parameters);
    // Columns [dZ_S/dp, Z_S, Z_R] of the pixels, real and imaginary parts.
    PassTile tile(parameters.size());
    const EdgeSums sums = for_each_warped_row(pass, times.get(), [&](int y) {
        HWY_DYNAMIC_DISPATCH(append_edge_row)(pass, y, tile);
    });
    HWY_DYNAMIC_DISPATCH(flush_edge_tile)(tile);
    return equations_from_gram(tile.gram(), value_of(sums, reference_energy_));
}

}  // namespace xcalib
#endif

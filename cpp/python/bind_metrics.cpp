#include <pybind11/stl.h>

#include <optional>

#include "arrays.hpp"
#include "bindings.hpp"
#include "compared.hpp"
#include "xcalib/judge/metrics.hpp"
#include "xcalib/option_words.hpp"

namespace xcalib {
namespace {

double nec_of(const py::object& reference, const py::object& registered, const py::object& mask,
              const std::string& floor) {
    const NecFloor value = value_of<NecFloor>("floor", floor);
    const Compared c(reference, registered, mask);
    const py::gil_scoped_release released;
    return nec(c.reference, c.registered, c.mask.data, value);
}

// A function of two images and a mask.
template <class Metric>
void def_metric(py::module_& m, const char* name, Metric metric, const char* doc) {
    m.def(
        name,
        [metric](const py::object& reference, const py::object& registered,
                 const py::object& mask) {
            const Compared c(reference, registered, mask);
            const py::gil_scoped_release released;
            return metric(c.reference, c.registered, c.mask.data);
        },
        py::arg("reference"), py::arg("registered"), py::arg("mask") = py::none(), doc);
}

// The same that depends on the span of the gray values.
template <class Metric>
void def_ranged(py::module_& m, const char* name, Metric metric, const char* doc) {
    m.def(
        name,
        [metric](const py::object& reference, const py::object& registered, const py::object& mask,
                 const std::optional<double>& data_range) {
            const Compared c(reference, registered, mask);
            const double range = c.range(data_range);
            const py::gil_scoped_release released;
            return metric(c.reference, c.registered, c.mask.data, range);
        },
        py::arg("reference"), py::arg("registered"), py::arg("mask") = py::none(),
        py::arg("data_range") = py::none(), doc);
}

py::array_t<float> patch_shifts(const py::object& reference, const py::object& registered,
                                const py::object& mask) {
    const Compared c(reference, registered, mask);
    const std::vector<PatchShift> shifts =
        unlocked([&] { return patch_residual(c.reference, c.registered, c.mask.data); });
    py::array_t<float> out({static_cast<py::ssize_t>(shifts.size()), py::ssize_t{4}});
    auto rows = out.mutable_unchecked<2>();
    for (std::size_t i = 0; i < shifts.size(); ++i) {
        const PatchShift& s = shifts[i];
        const float row[4] = {s.center_x, s.center_y, s.dx, s.dy};
        for (int k = 0; k < 4; ++k) rows(static_cast<py::ssize_t>(i), k) = row[k];
    }
    return out;
}

}  // namespace

void bind_metrics(py::module_& m) {
    m.def("nec", &nec_of, py::arg("reference"), py::arg("registered"), py::arg("mask") = py::none(),
          py::arg("floor") = "none",
          R"(Normalized Edge Correlation, Eq. (nec), in [0, 1]; NaN where no edge is left.

Images (H, W) or (H, W, 3) of one size, colour as blue-green-red; mask (H, W) as
Registrar.register() gives it: 0 where valid. floor: "none" (upper clamp
only, as the authors' code) or "printed" (Eq. (gradient_clamping) as printed).)");
    def_metric(m, "gc", &gc,
               "Gradient correlation: mean over x and y of the zero-mean normalized correlation "
               "of the absolute forward differences, in [-1, 1]. Images and mask as in nec().");
    def_metric(m, "ncc", &ncc,
               "Zero-mean normalized cross correlation, in [-1, 1]. Images and mask as in nec().");
    def_ranged(
        m, "rmse",
        [](const Image& reference, const Image& registered, const std::uint8_t* valid,
           double range) { return rmse(reference, registered, valid) / range; },
        "Root mean square error of gray values, as a share of data_range. Images, mask and "
        "data_range as in ssim().");
    def_ranged(m, "ssim", &ssim,
               "Structural similarity (Wang et al. 2004), Gaussian window of sigma 1.5 px, "
               "over pixels whose 11 x 11 window is valid. data_range: span of the gray "
               "values, by default that of the type of integers, and 1 for floats, which must "
               "then lie in [0, 1]. Images and mask as in nec().");
    def_ranged(m, "psnr", &psnr,
               "Peak signal-to-noise ratio [dB], 20 log10(data_range / RMSE). Images, mask "
               "and data_range as in ssim().");

    m.def("patch_shifts", &patch_shifts, py::arg("reference"), py::arg("registered"),
          py::arg("mask") = py::none(),
          "(N, 4) float32: centre x, y and residual shift dx, dy [px] of the patches with a clear "
          "peak; see "
          "metrics.patch_residual().");
}

}  // namespace xcalib

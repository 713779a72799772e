#include "arrays.hpp"
#include "bindings.hpp"
#include "compared.hpp"
#include "value_class.hpp"
#include "xcalib/flow.hpp"

namespace xcalib {
namespace {

py::tuple flow_of(const py::object& reference, const py::object& warped, const py::object& valid,
                  const FlowOptions& options, int num_threads) {
    const Compared c(reference, warped, valid, valid_of);
    const int width = c.reference.width, height = c.reference.height;
    py::array_t<float> flow({height, width, 2}), confidence({height, width});
    float* const vectors = flow.mutable_data();
    float* const sure = confidence.mutable_data();
    {
        const py::gil_scoped_release released;
        const FlowField field =
            patch_flow(c.reference, c.registered, c.mask.data, options, num_threads);
        const Image x = at_every_pixel(field, field.x, width, height);
        const Image y = at_every_pixel(field, field.y, width, height);
        for (std::size_t i = 0; i < x.pixels.size(); ++i) {
            vectors[2 * i] = x.pixels[i];
            vectors[2 * i + 1] = y.pixels[i];
        }
        const Image at_pixels = at_every_pixel(field, field.confidence, width, height);
        std::copy(at_pixels.pixels.begin(), at_pixels.pixels.end(), sure);
    }
    return py::make_tuple(flow, confidence);
}

}  // namespace

void bind_flow(py::module_& m) {
    ValueClass<FlowOptions>(m, "FlowOptions", "Options of patch_flow().")
        .def_options()
        .def_readwrite("step", &FlowOptions::step,
                       "Distance of patches on their grid [px], odd, >= 3.")
        .def_readwrite("patch", &FlowOptions::patch,
                       "Side of a patch [px], an odd multiple of the step.")
        .def_readwrite("levels", &FlowOptions::levels, "Levels of the pyramid, >= 1.")
        .def_readwrite("max_shift", &FlowOptions::max_shift,
                       "Farthest shift that the coarsest level looks for [px], >= 1.")
        .def("validate", &FlowOptions::validate,
             "Raises ValueError naming the field, its value and the allowed range.")
        .as_value();

    m.def("patch_flow", &flow_of, py::arg("reference"), py::arg("warped"),
          py::arg("valid") = py::none(), py::arg_v("options", FlowOptions{}, "FlowOptions()"),
          py::arg("num_threads") = 0,
          R"(Residual flow between a reference and a warped source of another modality.

Images (H, W) or (H, W, 3) of one size; valid (H, W), nonzero where the warped source is.
Returns (flow, confidence): flow (H, W, 2) float32 [px], what reference pixel p shows is found at
p + flow[p] in the warped source; confidence (H, W) float32 in [0, 1]. Both are linear between the
grid's points. num_threads: 0 uses every core; the result does not depend on it.
Raises ValueError with shapes and dtypes.)");
}

}  // namespace xcalib

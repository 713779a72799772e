#include <pybind11/functional.h>
#include <pybind11/stl.h>

#include <map>

#include "arrays.hpp"
#include "bindings.hpp"
#include "from_python.hpp"
#include "xcalib/footage/joined.hpp"
#include "xcalib/stream/neighbours.hpp"

namespace xcalib {
namespace {

// Sources by their lags; None where the footage has none.
struct HeldLags {
    std::vector<Held> held;
    std::vector<SourcesAtLag> lags;

    explicit HeldLags(const std::map<int, py::sequence>& sources) {
        for (const auto& [lag, images] : sources) {
            lags.push_back({lag, {}});
            const std::string name = "lag " + std::to_string(lag) + " source ";
            for (std::size_t i = 0; i < images.size(); ++i) {
                ImageView view;
                if (const py::object image = images[i]; !image.is_none()) {
                    held.push_back(image_of(name + std::to_string(i), image));
                    view = held.back().view;
                }
                lags.back().sources.push_back(view);
            }
        }
    }
};

}  // namespace

void bind_lags(py::module_& m) {
    m.def(
        "fit_lags",
        [](const py::sequence& references, const py::sequence& depths,
           const std::map<int, py::sequence>& sources, const Rig& rig,
           const CalibrationOptions& options) {
            const HeldList r = list_of("reference", references, image_of);
            const HeldList d = list_of("depth", depths, metric_depth_of);
            const HeldLags s(sources);
            const py::gil_scoped_release released;
            return fit_lags(r.views, d.views, s.lags, rig, options);
        },
        py::arg("references"), py::arg("depths"), py::arg("sources"), py::arg("rig"),
        py::arg_v("options", CalibrationOptions{}, "CalibrationOptions()"),
        R"(Whether the source is late by whole frames: a LagReport.

references, depths: a dozen of the frames that rig was fitted to, with options, as calibrate() takes
them, spread over the footage. sources: by lag, 0 among them, a list with the source so many frames
later than each reference's own, None where the footage has none. At each lag the rig is refitted,
and the NEC of the same references compared.)");
    m.def(
        "look_at_lags",
        [](const py::sequence& references, const py::sequence& sources, const py::sequence& depths,
           std::vector<int> partners, Stream& all_sources, const Rig& rig,
           const CalibrationOptions& options, const std::function<void(double)>& progress) {
            const HeldList r = list_of("reference", references, image_of);
            const HeldList s = list_of("source", sources, image_of);
            const HeldList d = list_of("depth", depths, metric_depth_of);
            const py::gil_scoped_release released;
            return fit_lags({r.views, s.views, d.views, std::move(partners)}, all_sources, rig,
                            options, progress);
        },
        py::arg("references"), py::arg("sources"), py::arg("depths"), py::arg("partners"),
        py::arg("all_sources"), py::arg("rig"), py::arg("options"), py::arg("progress"),
        R"(fit_lags() of a dozen of the frames that rig was fitted to, with options.

partners: the indices of their sources in all_sources, from which those before and after them are
read. Where all_sources is no sequence, or the footage is short, nothing is. progress: is called with
the share of the frames read.)");
    m.def(
        "add_lags",
        [](CalibrationResult& result, const LagReport& lag, const TimeOffset& offset,
           const Stream& all_sources) { add_lags(lag, offset, all_sources, result); },
        py::arg("result"), py::arg("lag"), py::arg("offset"), py::arg("all_sources"),
        "Puts the report into the result, which is no longer trusted if the source is late beyond "
        "offset.");
    m.def(
        "distrust",
        [](CalibrationResult& result, const std::string& reason, const std::string& advice) {
            result.distrust(reason, advice);
        },
        py::arg("result"), py::arg("reason"), py::arg("advice"),
        "The result is not to be trusted, and why; an empty reason changes nothing.");
    m.def(
        "joined_images",
        [](const py::object& images, const std::string& name) {
            const HeldList held = list_of("image", images, image_of);
            const py::gil_scoped_release released;
            return joined_images(held.views, name);
        },
        py::arg("images"), py::arg("name"),
        "(what is wrong, what to give instead) where most of the images look like two joined at "
        "their middle, one above the other or side by side; else two empty ones. name: REFERENCE "
        "or SOURCE.");
    m.def(
        "frames_later",
        [](const Stream& all_sources, const std::vector<int>& partners, int lag) {
            Pairing now;
            now.references = partners;
            for (std::size_t i = 0; i < partners.size(); ++i)
                now.references[i] = static_cast<int>(i);
            now.sources = partners;
            const Pairing later = with_lag(now, all_sources.frames(), lag);
            return std::pair(later.references, later.sources);
        },
        py::arg("all_sources"), py::arg("partners"), py::arg("lag"),
        py::call_guard<py::gil_scoped_release>(),
        "Of pairs with these partners in all_sources: those that have one lag frames later, and "
        "these "
        "partners.");
}

}  // namespace xcalib

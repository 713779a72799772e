#include "depth.hpp"

#include <charconv>
#include <cmath>
#include <cstdlib>
#include <optional>

#include "files.hpp"
#include "footage.hpp"
#include "xcalib/depth/complete_depth.hpp"
#include "xcalib/depth/steady_depth.hpp"
#include "xcalib/stream/arrays.hpp"
#include "xcalib/stream/files.hpp"
#include "xcalib/stream/tiff.hpp"
#include "yaml_keys.hpp"

namespace xcalib::cli {
namespace {

namespace fs = std::filesystem;

const std::string kDisparity = "disparity:";

bool is_png(const Path& file) { return lower_suffix(file) == ".png"; }

class Plane : public Depth {
   public:
    explicit Plane(const PlaneDepth& plane) : plane_(plane) {}
    Picture operator()(int, const Picture& reference) override {
        return picture_of(plane_(reference.view.width, reference.view.height));
    }
    bool concurrent() const override { return true; }
    bool looks_at_reference() const override { return false; }

   private:
    PlaneDepth plane_;
};

class Constant : public Depth {
   public:
    explicit Constant(float metres) : metres_(metres) {}
    Picture operator()(int, const Picture& reference) override {
        return picture_of(Image(reference.view.width, reference.view.height, metres_));
    }
    bool concurrent() const override { return true; }

   private:
    float metres_;
};

class Files : public Depth {
   public:
    Files(std::vector<Path> paths, DepthUnits units)
        : paths_(std::move(paths)), units_(std::move(units)) {}
    Picture operator()(int index, const Picture& reference) override {
        const Path& path = paths_[static_cast<std::size_t>(index)];
        const Picture depth = picture_of(read_depth(path, units_));
        const ImageView &map = depth.view, &image = reference.view;
        const long difference = std::labs(static_cast<long>(map.width) * image.height -
                                          static_cast<long>(map.height) * image.width);
        if (difference > std::max(image.width, image.height))
            throw InputError(path.string() + ": depth is " + size_text(map) +
                             ", but the reference image is " + size_text(image) +
                             "; expected the same aspect");
        return depth;
    }
    bool concurrent() const override { return true; }
    bool looks_at_reference() const override { return false; }
    std::vector<Path> files(int index) const override {
        return {paths_[static_cast<std::size_t>(index)]};
    }
    std::string line() const override {
        try {
            const Path& first = paths_.at(0);
            const Picture numbers = read_numbers(first);
            return units_line(numbers.view, units_, first.string(), is_png(first));
        } catch (const InputError&) {
            return "";  // which is said when the map is needed
        }
    }

   private:
    std::vector<Path> paths_;
    DepthUnits units_;
};

class Steadied : public Depth {
   public:
    explicit Steadied(DepthPointer depth) : depth_(std::move(depth)) {}
    Picture operator()(int index, const Picture& reference) override {
        const Picture depth = (*depth_)(index, reference);
        return picture_of(steadier_(index, depth.view, reference.view));
    }
    std::vector<Path> files(int index) const override { return depth_->files(index); }
    bool steadied() const override { return true; }
    std::string line() const override { return depth_->line(); }

   private:
    DepthPointer depth_;
    DepthSteadier steadier_;
};

class Completed : public Depth {
   public:
    Completed(DepthPointer depth, double min_confidence)
        : depth_(std::move(depth)), min_confidence_(min_confidence) {}
    Picture operator()(int index, const Picture& reference) override {
        const Picture depth = (*depth_)(index, reference);
        return picture_of(completed(depth.view, reference.view, min_confidence_));
    }
    std::vector<Path> files(int index) const override { return depth_->files(index); }
    bool concurrent() const override { return depth_->concurrent(); }
    bool steadied() const override { return depth_->steadied(); }
    std::string line() const override { return depth_->line(); }

   private:
    DepthPointer depth_;
    double min_confidence_;
};

// The number that a spec is, if it is one.
std::optional<double> number_of(const std::string& spec) {
    double value = 0;
    const char* const end = spec.data() + spec.size();
    if (std::from_chars(spec.data(), end, value).ptr != end || spec.empty()) return std::nullopt;
    return value;
}

// `baseline` [m], `focal` [px] and, if not 0, `doffs` [px] of a YAML file.
void read_stereo_calibration(const std::string& file, DepthUnits& units) {
    if (units.baseline != 0 || units.focal != 0 || units.doffs != 0)
        throw InputError("--stereo-calibration " + file +
                         ": expected no other stereo options with it");
    if (!fs::is_regular_file(file))
        throw InputError(file + ": no such file, expected a stereo calibration (.yaml)");
    const std::string names = "baseline, focal, doffs";
    const std::map<std::string, YAML::Node> keys = read_keys(file, names);
    for (const char* key : {"baseline", "focal"})
        if (!keys.count(key)) throw InputError(file + ": " + key + " is missing");
    for (const auto& [key, value] : keys) {
        double* const field = key == "baseline" ? &units.baseline
                              : key == "focal"  ? &units.focal
                              : key == "doffs"  ? &units.doffs
                                                : nullptr;
        if (!field) throw InputError(file + ": unknown key '" + key + "', expected " + names);
        const std::string text = value.IsScalar() ? value.Scalar() : "";
        const std::optional<double> number = number_of(text);
        if (!number) throw InputError(file + ": " + key + " is '" + text + "', expected a number");
        *field = *number;
    }
    if (units.baseline == 0)  // which stands for depth, not disparity
        throw InputError(file + ": stereo baseline is 0, expected above 0 m");
}

DepthPointer open_given(const DepthArguments& arguments, const FrameList& references,
                        const std::vector<int>& used) {
    std::string spec = arguments.spec;
    if (spec == "plane") return plane_depth(arguments.plane);
    if (spec.rfind("stereo:", 0) == 0)
        throw InputError("depth " + spec +
                         ": stereo partners are matched by the Python command, `xcalib`");
    DepthUnits units = arguments.units;
    if (spec.rfind(kDisparity, 0) == 0) {
        spec.erase(0, kDisparity.size());
        if (!arguments.stereo_calibration.empty())
            read_stereo_calibration(arguments.stereo_calibration, units);
        if (units.baseline == 0 || units.focal == 0)
            throw InputError(
                "--depth disparity: expected --stereo-baseline and --stereo-focal,"
                " or --stereo-calibration");
    } else if (units.baseline != 0 || units.focal != 0 || units.doffs != 0 ||
               !arguments.stereo_calibration.empty()) {
        throw InputError("depth " + spec +
                         ": stereo options go with --depth stereo:FOLDER or"
                         " disparity:FOLDER");
    }
    const Path folder(spec);
    if (lower_suffix(folder) == ".onnx" && !fs::is_directory(folder))
        throw InputError("depth " + spec + ": networks are run by the Python command, `xcalib`");
    if (spec.find('#') != std::string::npos && !fs::exists(folder))
        throw InputError("depth " + spec +
                         ": bags are read by the Python command, `xcalib`, with the extra `ros`");
    if (const auto metres = number_of(spec); metres && !fs::exists(folder))
        return constant_depth(*metres);
    if (!fs::is_directory(folder))
        throw InputError("depth " + spec +
                         ": expected an existing folder of depth maps, `plane`, or a distance in"
                         " metres");
    units.validate();
    const ImageFiles maps(list_files(folder, kDepthSuffixes));
    std::vector<Path> paths;
    const std::vector<Path> all = maps.paths();
    for (const int index : match_depths(references, used, maps.frames()))
        paths.push_back(all[static_cast<std::size_t>(index)]);
    return std::make_shared<Files>(std::move(paths), units);
}

}  // namespace

Picture read_numbers(const Path& file) {
    if (const auto array = read_array(file, ArrayKind::depth)) return *array;
    cv::Mat values = decode(file);
    if (values.channels() != 1)
        throw InputError(file.string() + ": depth has shape (" + std::to_string(values.rows) +
                         ", " + std::to_string(values.cols) + ", " +
                         std::to_string(values.channels()) + "), expected one channel (h, w)");
    const int depth = values.depth();
    if (is_png(file) && depth != CV_16U)
        throw InputError(file.string() + ": depth is " + type_name(depth) +
                         ", expected a 16-bit PNG");
    if (depth == CV_64F && tiff_pixel_type(read_file(file)) == "uint32")
        throw InputError(file.string() + ": depth is uint32, expected floats in metres");
    if (depth == CV_64F || depth == CV_16F) values.convertTo(values, CV_32F);
    if (values.depth() != CV_16U && values.depth() != CV_32F)
        throw InputError(file.string() + ": depth is " + type_name(depth) +
                         ", expected floats in metres");
    return picture_of(values);
}

Image read_depth(const Path& file, const DepthUnits& units) {
    return metres_of(read_numbers(file).view, units, file.string(), is_png(file));
}

DepthPointer constant_depth(double metres) {
    if (!(metres > 0 && std::isfinite(metres)))
        throw InputError("depth is " + std::to_string(metres) + ", expected a distance above 0 m");
    return std::make_shared<Constant>(static_cast<float>(metres));
}

DepthPointer plane_depth(const PlaneDepth& plane) { return std::make_shared<Plane>(plane); }

DepthPointer open_depth(const DepthArguments& arguments, const FrameList& references,
                        const std::vector<int>& used) {
    arguments.plane.validate();
    DepthPointer depth = open_given(arguments, references, used);
    if (arguments.steady) depth = std::make_shared<Steadied>(std::move(depth));
    if (arguments.complete)
        depth = std::make_shared<Completed>(std::move(depth), arguments.completion_confidence);
    return depth;
}

}  // namespace xcalib::cli

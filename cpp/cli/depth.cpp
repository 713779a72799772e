#include "depth.hpp"

#include <cmath>
#include <cstdlib>

#include "files.hpp"
#include "footage.hpp"
#include "xcalib/depth/complete_depth.hpp"
#include "xcalib/depth/steady_depth.hpp"
#include "xcalib/stream/npy.hpp"

namespace xcalib::cli {
namespace {

namespace fs = std::filesystem;

std::string type_name(int depth) {
    static const char* const kNames[] = {"uint8", "int8",    "uint16",  "int16",
                                         "int32", "float32", "float64", "float16"};
    return kNames[depth];
}

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

class Files : public Depth {
   public:
    Files(std::vector<Path> paths, double scale) : paths_(std::move(paths)), scale_(scale) {}
    Picture operator()(int index, const Picture& reference) override {
        const Path& path = paths_[static_cast<std::size_t>(index)];
        const Picture depth = picture_of(read_depth(path, scale_));
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

   private:
    std::vector<Path> paths_;
    double scale_;
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

   private:
    DepthPointer depth_;
    double min_confidence_;
};

DepthPointer open_given(const DepthArguments& arguments, const FrameList& references,
                        const std::vector<int>& used) {
    const std::string& spec = arguments.spec;
    if (spec == "plane") return plane_depth(arguments.plane);
    if (spec.rfind("stereo:", 0) == 0)
        throw InputError("depth " + spec +
                         ": stereo partners are matched by the Python command, `xcalib`");
    const Path folder(spec);
    if (lower_suffix(folder) == ".onnx" && !fs::is_directory(folder))
        throw InputError("depth " + spec + ": networks are run by the Python command, `xcalib`");
    if (spec.find('#') != std::string::npos && !fs::exists(folder))
        throw InputError("depth " + spec +
                         ": bags are read by the Python command, `xcalib`, with the extra `ros`");
    if (!fs::is_directory(folder))
        throw InputError("depth " + spec +
                         ": expected an existing folder of depth maps, or `plane`");
    if (!(arguments.scale > 0 && std::isfinite(arguments.scale))) {
        char text[64];
        std::snprintf(text, sizeof text, "%g", arguments.scale);
        throw InputError("depth scale is " + std::string(text) + ", expected above 0 m per count");
    }
    const ImageFiles maps(list_files(folder, kDepthSuffixes));
    std::vector<Path> paths;
    const std::vector<Path> all = maps.paths();
    for (const int index : match_depths(references, used, maps.frames()))
        paths.push_back(all[static_cast<std::size_t>(index)]);
    return std::make_shared<Files>(std::move(paths), arguments.scale);
}

}  // namespace

cv::Mat read_depth(const Path& file, double scale) {
    const std::string suffix = lower_suffix(file);
    cv::Mat depth;
    if (suffix == ".npy") {
        depth = mat_of(read_npy(file).view).clone();
    } else {
        const cv::Mat values = decode(file);
        if (values.channels() != 1)
            throw InputError(file.string() + ": depth has shape (" + std::to_string(values.rows) +
                             ", " + std::to_string(values.cols) + ", " +
                             std::to_string(values.channels()) + "), expected one channel (h, w)");
        if (suffix == ".png") {
            if (values.depth() != CV_16U)
                throw InputError(file.string() + ": depth is " + type_name(values.depth()) +
                                 ", expected a 16-bit PNG");
            depth.create(values.size(), CV_32F);
            const float metres = static_cast<float>(scale);
            for (int y = 0; y < depth.rows; ++y)
                for (int x = 0; x < depth.cols; ++x)
                    depth.at<float>(y, x) =
                        static_cast<float>(values.at<std::uint16_t>(y, x)) * metres;
        } else {
            if (values.depth() != CV_32F && values.depth() != CV_64F && values.depth() != CV_16F)
                throw InputError(file.string() + ": depth is " + type_name(values.depth()) +
                                 ", expected floats in metres");
            values.convertTo(depth, CV_32F);
        }
    }
    bool any = false;
    for (int y = 0; y < depth.rows; ++y)
        for (int x = 0; x < depth.cols; ++x) {
            float& value = depth.at<float>(y, x);
            if (value > 0 && std::isfinite(value)) any = true;
            else value = 0;
        }
    if (!any)
        throw InputError(file.string() + ": all depth is unknown, expected some pixels above 0 m");
    return depth;
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

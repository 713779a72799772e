#include "footage.hpp"

#include <glob.h>

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <regex>

#include "files.hpp"
#include "flir_files.hpp"
#include "video.hpp"

namespace xcalib::cli {
namespace {

namespace fs = std::filesystem;

// The pages of a TIFF stack.
class Pages : public Stream {
   public:
    explicit Pages(Path path) : path_(std::move(path)) {
        try {
            count_ = static_cast<int>(cv::imcount(path_.string(), cv::IMREAD_UNCHANGED));
        } catch (const cv::Exception&) {
            count_ = 0;
        }
        if (count_ == 0)
            throw InputError(path_.string() + ": cannot decode, truncated or not a TIFF");
    }
    int size() const override { return count_; }
    std::string name(int index) const override { return six_digits(index); }
    std::string where(int index) const override {
        return path_.string() + " page " + std::to_string(index);
    }
    Path file(int) const override { return path_; }

   private:
    Picture read(int index) override {
        std::vector<cv::Mat> pages;
        try {
            cv::imreadmulti(path_.string(), pages, index, 1, cv::IMREAD_UNCHANGED);
        } catch (const std::exception&) {  // of OpenCV; of memory, for a size that is claimed
            pages.clear();
        }
        if (pages.size() != 1) throw DecodeError(where(index) + ": cannot decode, truncated");
        return picture_of(as_image(pages[0], where(index)));
    }

    Path path_;
    int count_ = 0;
};

std::vector<Path> matching_files(const Path& pattern) {
    static const std::regex numbered(R"((.*)%(0\d{1,3})?d(.*))");
    std::smatch number;
    const std::string name = pattern.filename().string();
    std::vector<Path> found;
    if (std::regex_match(name, number, numbered)) {
        const std::string before = number[1], after = number[3];
        const std::size_t width = number[2].matched ? std::stoul(number[2]) : 1;
        const Path folder = pattern.has_parent_path() ? pattern.parent_path() : Path(".");
        if (fs::is_directory(folder))
            for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
                const std::string file = entry.path().filename().string();
                if (file.size() < before.size() + width + after.size() ||
                    file.compare(0, before.size(), before) != 0 ||
                    file.compare(file.size() - after.size(), after.size(), after) != 0)
                    continue;
                const auto first = file.begin() + static_cast<std::ptrdiff_t>(before.size());
                const auto last = file.end() - static_cast<std::ptrdiff_t>(after.size());
                if (std::all_of(first, last, [](char c) { return c >= '0' && c <= '9'; }))
                    found.push_back(pattern.has_parent_path() ? folder / file : Path(file));
            }
    } else {
        glob_t matches{};
        if (glob(pattern.c_str(), 0, nullptr, &matches) == 0)
            found.assign(matches.gl_pathv, matches.gl_pathv + matches.gl_pathc);
        globfree(&matches);
    }
    const auto unusable = [](const Path& file) {
        return !(has_suffix(file, kImageSuffixes) || has_suffix(file, kArraySuffixes)) ||
               !fs::is_regular_file(file);
    };
    found.erase(std::remove_if(found.begin(), found.end(), unusable), found.end());
    if (found.empty()) throw InputError(pattern.string() + ": no image file matches");
    return in_natural_order(std::move(found));
}

bool is_pattern(const std::string& name) {
    static const std::regex pattern(R"([*?\[]|%(0\d{1,3})?d)");
    return std::regex_search(name, pattern);
}

bool is_bag(const Path& path) {
    if (has_suffix(path, {".bag", ".mcap", ".db3"})) return true;
    return fs::is_directory(path) && fs::exists(path / "metadata.yaml");
}

StreamPointer radiometric(const StreamPointer& stream, const std::string& part,
                          const std::string& spec) {
    const std::vector<Path> paths = stream->paths();
    if (paths.empty() || !is_radiometric(paths[0]))
        throw InputError(spec + ": expected radiometric JPEGs of a FLIR camera before #" + part);
    return std::make_shared<RadiometricFiles>(paths, part);
}

[[noreturn]] void refuse_bag(const std::string& spec) {
    throw InputError(spec +
                     ": bags are read by the Python command, `xcalib`, with the extra `ros`");
}

}  // namespace

ImageFiles::ImageFiles(std::vector<Path> paths) : paths_(std::move(paths)) {
    std::vector<std::string> stems;
    for (const Path& path : paths_) stems.push_back(path.stem().string());
    times = times_of_names(stems);
    if (const auto beside = times_beside(paths_, *this, said)) times = beside;
}

StreamPointer open_stream(const std::string& spec) {
    const Path path(spec);
    const std::size_t hash = spec.rfind('#');
    if (!fs::exists(path) && hash != std::string::npos) {
        const std::string base = spec.substr(0, hash), part = spec.substr(hash + 1);
        if (std::find(kHalves.begin(), kHalves.end(), part) != kHalves.end())
            return std::make_shared<Half>(open_stream(base), part);
        if (std::find(kRadiometricParts.begin(), kRadiometricParts.end(), part) !=
            kRadiometricParts.end())
            return radiometric(open_stream(base), part, spec);
        if (is_bag(base)) refuse_bag(spec);
        throw InputError(spec +
                         ": expected one of #left, #right, #top, #bottom behind a path, or,"
                         " behind radiometric JPEGs, of #visible, #thermal, #temperature");
    }
    if (is_bag(path)) refuse_bag(spec);
    if (fs::is_regular_file(path)) {
        if (has_suffix(path, {".tif", ".tiff"})) return std::make_shared<Pages>(path);
        if (has_suffix(path, kVideoSuffixes)) return open_video(path);
    } else if (!fs::is_directory(path)) {
        if (is_pattern(path.filename().string()))
            return std::make_shared<ImageFiles>(matching_files(path));
        if (has_suffix(path, kVideoSuffixes)) throw InputError(spec + ": no such file");
    }
    return std::make_shared<ImageFiles>(list_images(path));
}

std::pair<StreamPointer, StreamPointer> open_two(const std::string& reference,
                                                 const std::string& source) {
    StreamPointer first = open_stream(reference), second = open_stream(source);
    const std::vector<Path> paths = first->paths();
    if (!paths.empty() && paths == second->paths() && is_radiometric(paths[0])) {
        first = std::make_shared<RadiometricFiles>(paths, "visible");
        second = std::make_shared<RadiometricFiles>(paths, "thermal");
        first->said = reference +
                      ": radiometric JPEGs, of which the visible image is the reference"
                      " and the raw thermal one the source";
    }
    return {first, second};
}

}  // namespace xcalib::cli

#include "xcalib/footage/false_colour.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "base/median.hpp"

namespace xcalib {
namespace {

using Colour = std::array<std::uint8_t, 3>;
using Point = std::array<double, 3>;

// All but kSamples, kShare, kThin and the counts are distances in the colour cube [of 255].
constexpr double kNear = 24.0;  // within it a colour lies on the curve: JPEG moves colours by 10
constexpr double kShare = 0.9;  // of the pixels that must lie near: the rest is text, a colour bar,
                                // and edges in JPEG
constexpr int kColourful = 40;  // difference of the largest and smallest channel of such a pixel
constexpr double kKnownBonus = 4.0;  // by this an estimated map must be nearer than a known one
constexpr double kThin = 0.045;      // largest thickness of an estimated curve, as a share of its
                                     // length: photographs begin at 0.055
constexpr double kSpan = 150.0;      // of the curve that the pixels must use: less is a tint
constexpr std::size_t kSamples = 4000;  // pixels a decision is made on
constexpr int kCell = 16;    // side of the cells of the cube in which a curve is looked for
constexpr int kCells = 400;  // that a curve of any map can fill, at most; a photograph fills more
constexpr int kImages = 4;

std::uint8_t byte_of(const ImageView& image, int x, int y, int channel) {
    const int at = x * image.channels + channel;
    switch (image.type) {
        case PixelType::u8: return image.row<std::uint8_t>(y)[at];
        case PixelType::u16: return static_cast<std::uint8_t>(image.row<std::uint16_t>(y)[at] >> 8);
        case PixelType::f32: break;
    }
    const float value = image.row<float>(y)[at];
    return static_cast<std::uint8_t>(255 *
                                     std::clamp(std::isnan(value) ? 0.0f : value, 0.0f, 1.0f));
}

Colour colour_of(const ImageView& image, int x, int y) {
    return {byte_of(image, x, y, 0), byte_of(image, x, y, 1), byte_of(image, x, y, 2)};
}

struct Nearest {
    int place;  // on the curve
    int squared_distance;
};

Nearest nearest(const ColorMap& map, const Colour& colour) {
    Nearest found{0, std::numeric_limits<int>::max()};
    for (int place = 0; place < 256; ++place) {
        int squared = 0;
        for (int c = 0; c < 3; ++c) {
            const int difference = map.curve[place][c] - colour[c];
            squared += difference * difference;
        }
        if (squared < found.squared_distance) found = {place, squared};
    }
    return found;
}

template <class A, class B>
double distance(const A& a, const B& b) {
    double squared = 0;
    for (int c = 0; c < 3; ++c) squared += (double(a[c]) - b[c]) * (double(a[c]) - b[c]);
    return std::sqrt(squared);
}

// Straight from each stop to the next, `values[i]` at `places[i]`, at 256 even places.
ColorMap through(const std::string& name, const std::vector<double>& places,
                 const std::vector<Point>& stops) {
    ColorMap map{name, {}};
    for (int i = 0; i < 256; ++i) {
        const double at = places.back() * i / 255;
        std::size_t k = 1;
        while (k + 1 < places.size() && places[k] < at) ++k;
        const double share = (at - places[k - 1]) / (places[k] - places[k - 1]);
        for (int c = 0; c < 3; ++c)
            map.curve[i][c] = static_cast<std::uint8_t>(
                std::nearbyint(stops[k - 1][c] + share * (stops[k][c] - stops[k - 1][c])));
    }
    return map;
}

std::vector<ColorMap> make_known_maps() {
    static constexpr std::pair<const char*, cv::ColormapTypes> kOfOpenCv[] = {
        {"autumn", cv::COLORMAP_AUTUMN},
        {"jet", cv::COLORMAP_JET},
        {"winter", cv::COLORMAP_WINTER},
        {"rainbow", cv::COLORMAP_RAINBOW},
        {"ocean", cv::COLORMAP_OCEAN},
        {"summer", cv::COLORMAP_SUMMER},
        {"spring", cv::COLORMAP_SPRING},
        {"cool", cv::COLORMAP_COOL},
        {"hsv", cv::COLORMAP_HSV},
        {"pink", cv::COLORMAP_PINK},
        {"hot", cv::COLORMAP_HOT},
        {"parula", cv::COLORMAP_PARULA},
        {"magma", cv::COLORMAP_MAGMA},
        {"inferno", cv::COLORMAP_INFERNO},
        {"plasma", cv::COLORMAP_PLASMA},
        {"viridis", cv::COLORMAP_VIRIDIS},
        {"cividis", cv::COLORMAP_CIVIDIS},
        {"twilight", cv::COLORMAP_TWILIGHT},
        {"twilight_shifted", cv::COLORMAP_TWILIGHT_SHIFTED},
        {"turbo", cv::COLORMAP_TURBO},
        {"deepgreen", cv::COLORMAP_DEEPGREEN},
    };
    cv::Mat ramp(256, 1, CV_8UC1), colours;
    for (int i = 0; i < 256; ++i) ramp.at<std::uint8_t>(i) = static_cast<std::uint8_t>(i);
    std::vector<ColorMap> maps;
    for (const auto& [name, type] : kOfOpenCv) {
        cv::applyColorMap(ramp, colours, type);
        ColorMap map{name, {}};
        for (int i = 0; i < 256; ++i)
            for (int c = 0; c < 3; ++c) map.curve[i][c] = colours.at<cv::Vec3b>(i)[c];
        maps.push_back(map);
    }
    // The palette that camera makers call iron: black, blue, purple, red, orange, yellow, white.
    maps.push_back(through("iron", {0, 42.5, 85, 127.5, 170, 212.5, 255},
                           {{0, 0, 0},
                            {140, 0, 30},
                            {150, 0, 140},
                            {30, 70, 220},
                            {0, 160, 250},
                            {90, 230, 255},
                            {255, 255, 255}}));
    return maps;
}

// Distance from the curve within which the share kShare of the colours lies.
double thickness(const ColorMap& map, const std::vector<Colour>& colours) {
    std::vector<double> distances;
    for (const Colour& colour : colours)
        distances.push_back(std::sqrt(nearest(map, colour).squared_distance));
    return quantile(std::move(distances), kShare);
}

// Length of the part of the curve between the 2nd and the 98th percentile of the pixels.
double used_length(const ColorMap& map, const std::vector<Colour>& colours) {
    std::vector<int> places;
    for (const Colour& colour : colours) places.push_back(nearest(map, colour).place);
    const int first = static_cast<int>(quantile(places, 0.02));
    const int last = static_cast<int>(quantile(places, 0.98));
    double length = 0;
    for (int i = first; i < last; ++i) length += distance(map.curve[i], map.curve[i + 1]);
    return length;
}

// -- A curve from the colours themselves ----------------------------------------------------------

struct Cell {
    std::array<int, 3> place;
    double count = 0;
    Point mean{};
};

// Cells of the cube that together hold nearly all pixels, the fullest first.
std::vector<Cell> occupied(const std::vector<Colour>& colours) {
    std::map<std::array<int, 3>, Cell> cells;
    for (const Colour& colour : colours) {
        // In the order of red, green, blue, so that equally full cells come in a fixed one.
        const std::array<int, 3> place{colour[2] / kCell, colour[1] / kCell, colour[0] / kCell};
        Cell& cell = cells[place];
        cell.place = place;
        ++cell.count;
        for (int c = 0; c < 3; ++c) cell.mean[c] += colour[c];
    }
    std::vector<Cell> found;
    for (auto& [place, cell] : cells) {
        for (double& value : cell.mean) value /= cell.count;
        found.push_back(cell);
    }
    std::stable_sort(found.begin(), found.end(),
                     [](const Cell& a, const Cell& b) { return a.count > b.count; });
    // The fullest cells until 97 % of the pixels are in: noise fills the others, one by one.
    double in = 0;
    std::size_t kept = 0;
    while (kept < found.size() && in < 0.97 * static_cast<double>(colours.size()))
        in += found[kept++].count;
    found.resize(kept);
    return found;
}

// Distance of each cell from one, in steps between cells at most two apart (Dijkstra).
std::vector<double> along(const std::vector<Cell>& cells, std::size_t start) {
    std::vector<double> distances(cells.size(), INFINITY);
    std::vector<bool> seen(cells.size());
    distances[start] = 0;
    while (true) {
        std::size_t here = cells.size();
        for (std::size_t i = 0; i < cells.size(); ++i)
            if (!seen[i] && std::isfinite(distances[i]) &&
                (here == cells.size() || distances[i] < distances[here]))
                here = i;
        if (here == cells.size()) break;
        seen[here] = true;
        for (std::size_t i = 0; i < cells.size(); ++i) {
            int apart = 0;
            for (int c = 0; c < 3; ++c)
                apart = std::max(apart, std::abs(cells[i].place[c] - cells[here].place[c]));
            if (apart <= 2)
                distances[i] = std::min(
                    distances[i], distances[here] + distance(cells[i].mean, cells[here].mean));
        }
    }
    // Islands apart from the rest are not of the curve.
    for (double& value : distances)
        if (!std::isfinite(value)) value = 0;
    return distances;
}

double luma(const Point& colour) {
    return 0.114 * colour[0] + 0.587 * colour[1] + 0.299 * colour[2];
}

// The curve that the colours lie on; none if they fill more of the cube than a curve does.
// Distances are measured along the cloud of colours, cell by cell, so that a curve that winds is
// unrolled; the two colours farthest apart in this sense are its ends. What is equally far from one
// end is averaged.
std::optional<ColorMap> estimated(const std::vector<Colour>& colours) {
    const std::vector<Cell> cells = occupied(colours);
    if (cells.size() < 4 || cells.size() > kCells) return std::nullopt;
    const auto farthest = [](const std::vector<double>& from) {
        return static_cast<std::size_t>(std::max_element(from.begin(), from.end()) - from.begin());
    };
    const std::vector<double> far = along(cells, farthest(along(cells, 0)));
    const double length = far[farthest(far)];
    if (length < kSpan) return std::nullopt;
    std::vector<Point> curve;
    for (int i = 0; i * (kCell / 2.0) < length + kCell / 2.0; ++i) {
        // A window of a cell's width, weighted by how many pixels a cell has.
        Point sum{};
        double weights = 0;
        for (std::size_t k = 0; k < cells.size(); ++k) {
            const double away = (i * (kCell / 2.0) - far[k]) / kCell;
            const double weight = cells[k].count * std::exp(-0.5 * away * away);
            weights += weight;
            for (int c = 0; c < 3; ++c) sum[c] += weight * cells[k].mean[c];
        }
        for (double& value : sum) value /= weights;
        curve.push_back(sum);
    }
    if (luma(curve.front()) > luma(curve.back())) std::reverse(curve.begin(), curve.end());
    std::vector<double> lengths{0};
    for (std::size_t i = 1; i < curve.size(); ++i)
        lengths.push_back(lengths.back() + distance(curve[i], curve[i - 1]));
    return through("estimated", lengths, curve);
}

// Some pixels of all images; none if one has no colour channels.
std::vector<Colour> sample(const std::vector<ImageView>& images) {
    std::vector<Colour> colours;
    for (const ImageView& image : images) {
        if (image.channels != 3) return {};
        const std::size_t count = static_cast<std::size_t>(image.width) * image.height;
        const std::size_t step = std::max<std::size_t>(1, count * images.size() / kSamples);
        for (std::size_t i = 0; i < count; i += step)
            colours.push_back(colour_of(image, static_cast<int>(i % image.width),
                                        static_cast<int>(i / image.width)));
    }
    return colours;
}

}  // namespace

std::vector<std::uint8_t> ColorMap::invert(const ImageView& image) const {
    std::vector<std::uint8_t> places;
    places.reserve(static_cast<std::size_t>(image.width) * image.height);
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x)
            places.push_back(
                static_cast<std::uint8_t>(nearest(*this, colour_of(image, x, y)).place));
    return places;
}

const std::vector<ColorMap>& known_color_maps() {
    static const std::vector<ColorMap> maps = make_known_maps();
    return maps;
}

const ColorMap& known_color_map(const std::string& name) {
    std::vector<std::string> names;
    for (const ColorMap& map : known_color_maps()) {
        if (map.name == name) return map;
        names.push_back(map.name);
    }
    std::sort(names.begin(), names.end());
    std::string list;
    for (const std::string& known : names) list += (list.empty() ? "" : ", ") + known;
    throw InputError("colour map '" + name + "' is not known, expected auto, none or one of " +
                     list);
}

std::vector<int> frames_to_recognise_by(int count) {
    std::vector<int> frames;
    for (int i = 0; i < kImages; ++i) {
        const int frame =
            static_cast<int>(std::nearbyint((count - 1) * static_cast<double>(i) / (kImages - 1)));
        if (frames.empty() || frames.back() != frame) frames.push_back(frame);
    }
    return frames;
}

std::optional<ColorMap> recognise(const std::vector<ImageView>& images) {
    const std::vector<Colour> colours = sample(images);
    if (colours.empty()) return std::nullopt;
    const auto is_colourful = [](const Colour& colour) {
        const auto [least, most] = std::minmax_element(colour.begin(), colour.end());
        return *most - *least > kColourful;
    };
    const double colourful =
        static_cast<double>(std::count_if(colours.begin(), colours.end(), is_colourful)) /
        static_cast<double>(colours.size());
    if (colourful < 0.3) return std::nullopt;
    const ColorMap* best = nullptr;
    double thinnest = INFINITY;
    for (const ColorMap& map : known_color_maps())
        if (const double value = thickness(map, colours); value < thinnest) {
            thinnest = value;
            best = &map;
        }
    const std::optional<ColorMap> own = estimated(colours);
    const double own_thickness = own ? thickness(*own, colours) : INFINITY;
    // The curve through the colours themselves is nearly always a little nearer than a known one.
    if (best && thinnest < std::min(kNear, own_thickness + kKnownBonus))
        return used_length(*best, colours) > kSpan ? std::optional(*best) : std::nullopt;
    // Without a known map as a witness, only what no photograph has shown will do.
    if (!own || colourful < 0.6) return std::nullopt;
    const bool thin = own_thickness < std::min(kNear, kThin * used_length(*own, colours));
    return thin ? own : std::nullopt;
}

}  // namespace xcalib

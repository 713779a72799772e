#include "xcalib/stream/stream.hpp"

#include <algorithm>
#include <cstring>

#include "base/format.hpp"
#include "xcalib/error.hpp"
#include "xcalib/footage/false_colour.hpp"
#include "xcalib/stream/files.hpp"

namespace xcalib {
namespace {

// The rows and columns [left, left + width) of a picture, as a picture of its own.
Picture cut(const Picture& picture, int left, int top, int width, int height) {
    const ImageView& from = picture.view;
    const std::size_t pixel = bytes_per_channel(from.type) * from.channels;
    MutableImageView to;
    Picture out = new_picture(width, height, from.channels, from.type, to);
    for (int y = 0; y < height; ++y)
        std::memcpy(static_cast<char*>(to.data) + y * to.row_bytes,
                    from.row<char>(top + y) + pixel * left, pixel * width);
    return out;
}

Picture half_of(const Picture& picture, const std::string& half, const std::string& where) {
    const ImageView& image = picture.view;
    const bool beside = half == "left" || half == "right";
    const bool first = half == "left" || half == "top";
    const int side = beside ? image.width : image.height;
    if (side % 2)
        throw InputError(where + ": its " + (beside ? "width" : "height") + " is " +
                         std::to_string(side) + " px, expected an even one to take the " + half +
                         " half");
    const int start = first ? 0 : side / 2;
    if (beside) return cut(picture, start, 0, side / 2, image.height);
    return cut(picture, 0, start, image.width, side / 2);
}

StreamPointer inverted(StreamPointer stream, const ColorMap& map) {
    return std::make_shared<Converted>(std::move(stream), [map](const Picture& picture, int) {
        const ImageView& image = picture.view;
        if (image.channels != 3) return picture;
        const auto places = std::make_shared<const std::vector<std::uint8_t>>(map.invert(image));
        return Picture{{places->data(), image.width, image.height, 1, PixelType::u8, image.width},
                       places};
    });
}

}  // namespace

Picture Stream::operator[](int index) {
    Picture image = read(index);
    require_one_size(index, image.view);
    return image;
}

Picture Stream::outline(int index) {
    const std::optional<HeaderSize> size = size_in_header(index);
    if (!size) return (*this)[index];
    ImageView view;
    view.width = size->width;
    view.height = size->height;
    require_one_size(index, view);
    const std::lock_guard lock(mutex_);
    if (outline_.empty()) {
        MutableImageView pixels;
        outline_ = new_picture(view.width, view.height, 1, PixelType::u8, pixels);
        std::memset(pixels.data, 0, pixels.row_bytes * static_cast<std::size_t>(view.height));
    }
    return outline_;
}

void Stream::require_one_size(int index, const ImageView& image) {
    ImageView first;
    {
        const std::lock_guard lock(mutex_);
        if (first_ < 0) {
            first_ = index;
            first_size_.width = image.width;
            first_size_.height = image.height;
        }
        first = first_size_;
    }
    if (image.width != first.width || image.height != first.height)
        throw InputError(where(index) + " is " + size_text(image) + ", expected " +
                         size_text(first) + " as " +
                         std::filesystem::path(where(first_)).filename().string());
}

FrameList Stream::frames() const {
    FrameList list;
    for (int i = 0; i < size(); ++i) {
        list.names.push_back(name(i));
        list.where.push_back(where(i));
    }
    list.paths = paths();
    list.times = times;
    return list;
}

Picked::Picked(StreamPointer stream, std::vector<int> indices)
    : stream_(std::move(stream)), indices_(std::move(indices)) {
    if (!stream_->times) return;
    times.emplace();
    for (const int index : indices_)
        times->push_back(stream_->times->at(static_cast<std::size_t>(index)));
}

StreamPointer picked(StreamPointer stream, const std::vector<int>& indices) {
    bool all = static_cast<int>(indices.size()) == stream->size();
    for (std::size_t i = 0; i < indices.size(); ++i) all = all && indices[i] == static_cast<int>(i);
    if (all) return stream;
    return std::make_shared<Picked>(std::move(stream), indices);
}

Half::Half(StreamPointer stream, std::string half)
    : Converted(stream,
                [stream, half](const Picture& picture, int index) {
                    return half_of(picture, half, stream->where(index));
                }),
      half_(std::move(half)) {}

std::vector<double> read_times(const std::filesystem::path& table, const Stream& stream) {
    const std::string text = read_file(table);
    const std::vector<double> in_order = times_in_order(text);
    if (in_order.empty()) return times_of_table(text, table.string(), stream.frames().names);
    if (static_cast<int>(in_order.size()) != stream.size())
        throw InputError(table.string() + ": " + std::to_string(in_order.size()) +
                         " times without names, for " + std::to_string(stream.size()) +
                         " frames; expected as many, or lines `name timestamp`");
    if (!std::is_sorted(in_order.begin(), in_order.end()))
        throw InputError(table.string() + ": times fall, expected them to rise");
    return in_order;
}

std::optional<std::vector<double>> times_beside(const std::vector<std::filesystem::path>& files,
                                                const Stream& stream, std::string& said) {
    for (const char* name : {"timestamps.csv", "timestamps.txt"}) {
        if (files.empty()) break;
        const std::filesystem::path table = files[0].parent_path() / name;
        if (!std::filesystem::is_regular_file(table)) continue;
        const std::size_t count = times_in_order(read_file(table)).size();
        if (count == 0 || count == files.size()) return read_times(table, stream);
        said = table.string() + ": " + std::to_string(count) + " times without names, for " +
               std::to_string(files.size()) + " frames; not used";
    }
    return std::nullopt;
}

StreamPointer scalar_sources(StreamPointer sources, const std::string& colormap,
                             std::string& said) {
    if (colormap == "none") return sources;
    if (colormap != "auto") return inverted(std::move(sources), known_color_map(colormap));
    std::vector<Picture> some;
    for (const int index : frames_to_recognise_by(sources->size())) {
        try {
            some.push_back((*sources)[index]);
        } catch (const DecodeError&) {
            // Met again, and named, when its turn comes.
        }
    }
    std::vector<ImageView> views;
    for (const Picture& image : some) views.push_back(image.view);
    const std::optional<ColorMap> found = recognise(views);
    if (!found) return sources;
    said = "source images are false colour (map: " + found->name +
           "), turned back to numbers; --source-colormap none keeps their colours";
    return inverted(std::move(sources), *found);
}

std::string six_digits(int index) { return format("%06d", index); }

}  // namespace xcalib

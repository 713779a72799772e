#include "xcalib/stream/oriented.hpp"

#include <cstring>
#include <system_error>

#include "xcalib/footage/exif.hpp"
#include "xcalib/stream/files.hpp"

namespace xcalib {
namespace {

class Oriented : public Converted {
   public:
    explicit Oriented(const StreamPointer& stream)
        : Converted(stream, [stream](const Picture& picture, int index) {
              return oriented(picture, exif_orientation(read_file(stream->file(index))));
          }) {}
    std::vector<std::filesystem::path> paths() const override { return stream_->paths(); }
};

}  // namespace

Picture oriented(const Picture& picture, int orientation) {
    if (orientation == 1) return picture;
    const ImageView& from = picture.view;
    const bool turned = orientation >= 5;
    const int width = turned ? from.height : from.width;
    const int height = turned ? from.width : from.height;
    const std::size_t pixel =
        bytes_per_channel(from.type) * static_cast<std::size_t>(from.channels);
    MutableImageView to;
    Picture out = new_picture(width, height, from.channels, from.type, to);
    // Whether columns and rows of the stored picture are counted from their ends.
    const bool back_x = orientation == 2 || orientation == 3 || orientation >= 7;
    const bool back_y =
        orientation == 3 || orientation == 4 || orientation == 6 || orientation == 7;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const int column = turned ? y : x, row = turned ? x : y;
            const int at_x = back_x ? from.width - 1 - column : column;
            const int at_y = back_y ? from.height - 1 - row : row;
            std::memcpy(static_cast<char*>(to.data) + y * to.row_bytes +
                            pixel * static_cast<std::size_t>(x),
                        from.row<char>(at_y) + pixel * static_cast<std::size_t>(at_x), pixel);
        }
    return out;
}

StreamPointer oriented(StreamPointer stream) {
    if (stream->paths().empty()) return stream;
    return std::make_shared<Oriented>(stream);
}

std::string orientation_line(const Stream& stream, bool applied) {
    if (stream.paths().empty()) return "";
    int orientation = 1;
    try {
        orientation = exif_orientation(read_file(stream.file(0)));
    } catch (const std::system_error&) {
        // Named when it is to be decoded.
    }
    if (orientation == 1) return "";
    return stream.where(0) + " says that its picture " + orientation_text(orientation) +
           (applied
                ? ", which is done; depth must be that of the turned picture"
                : "; pixels are taken as they are stored (--exif-orientation apply turns them)");
}

}  // namespace xcalib

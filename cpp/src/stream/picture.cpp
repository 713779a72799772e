#include "xcalib/stream/picture.hpp"

#include <cstddef>

namespace xcalib {

Picture new_picture(int width, int height, int channels, PixelType type, MutableImageView& pixels) {
    const std::size_t row = bytes_per_channel(type) * width * channels;
    const std::shared_ptr<std::byte[]> bytes(new std::byte[row * height]);
    const auto row_bytes = static_cast<std::ptrdiff_t>(row);
    pixels = {bytes.get(), width, height, channels, type, row_bytes};
    return {{bytes.get(), width, height, channels, type, row_bytes}, bytes};
}

Picture picture_of(Image image) {
    const auto owner = std::make_shared<const Image>(std::move(image));
    return {owner->view(), owner};
}

std::string size_text(const ImageView& image) {
    return std::to_string(image.width) + "x" + std::to_string(image.height);
}

}  // namespace xcalib

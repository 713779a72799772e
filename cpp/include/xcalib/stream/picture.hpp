// Images that are handed on: between the parts of a stream, from thread to thread.
#pragma once

#include <memory>
#include <string>

#include "xcalib/export.hpp"
#include "xcalib/image.hpp"

namespace XCALIB_EXPORT xcalib {

// An image of 1 or 3 channels that keeps its pixels alive, whoever made them. Copies share the
// pixels, which nobody changes.
struct Picture {
    ImageView view;
    std::shared_ptr<const void> owner;

    bool empty() const { return view.data == nullptr; }
};

// A picture with pixels of its own, to be written through `pixels` before it is handed on.
Picture new_picture(int width, int height, int channels, PixelType type, MutableImageView& pixels);
Picture picture_of(Image image);

std::string size_text(const ImageView& image);  // 640x480

}  // namespace xcalib

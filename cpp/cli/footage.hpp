// Footage from files: images, patterns of names, TIFF stacks, videos.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "pictures.hpp"
#include "xcalib/stream/stream.hpp"

namespace xcalib::cli {

// A list of image files; their times stand in their names or in a table beside them.
class ImageFiles : public Stream {
   public:
    explicit ImageFiles(std::vector<Path> paths);
    int size() const override { return static_cast<int>(paths_.size()); }
    std::string name(int index) const override { return at(index).stem().string(); }
    std::string where(int index) const override { return at(index).string(); }
    Path file(int index) const override { return at(index); }
    std::vector<Path> paths() const override { return paths_; }
    bool concurrent() const override { return true; }
    std::optional<HeaderSize> size_in_header(int index) override { return header_size(at(index)); }

   private:
    Picture read(int index) override { return picture_of(read_image(at(index))); }
    const Path& at(int index) const { return paths_[static_cast<std::size_t>(index)]; }

    std::vector<Path> paths_;
};

// What REFERENCE or SOURCE names: a folder of images; a pattern (`shots/*.png`, `shots/%06d.png`);
// a TIFF stack; a video. `#left`, `#right`, `#top` or `#bottom` behind any of them takes that half
// of each frame. A path that exists is taken as it is, whatever is in its name.
StreamPointer open_stream(const std::string& spec);

// Both, one after the other. Radiometric JPEGs given as both are the visible image and the raw
// thermal one in each.
std::pair<StreamPointer, StreamPointer> open_two(const std::string& reference,
                                                 const std::string& source);

}  // namespace xcalib::cli

#include <gtest/gtest.h>

#include <cstring>

#include "xcalib/stream/oriented.hpp"

namespace xcalib {
namespace {

// 3x2 pixels, rows from the top:  a b c / d e f.
Picture letters(int channels) {
    MutableImageView pixels;
    Picture picture = new_picture(3, 2, channels, PixelType::u8, pixels);
    const char* const text = "abcdef";
    for (int y = 0; y < 2; ++y)
        for (int x = 0; x < 3; ++x)
            std::memset(static_cast<char*>(pixels.data) + y * pixels.row_bytes + x * channels,
                        text[3 * y + x], static_cast<std::size_t>(channels));
    return picture;
}

std::string letters_of(const Picture& picture) {
    std::string text;
    for (int y = 0; y < picture.view.height; ++y) {
        text += y ? " " : "";
        for (int x = 0; x < picture.view.width; ++x)
            text += picture.view.row<char>(y)[x * picture.view.channels];
    }
    return text;
}

TEST(Oriented, EveryOrientationOfExif) {
    const char* const expected[] = {"abc def",  "cba fed",  "fed cba",  "def abc",
                                    "ad be cf", "da eb fc", "fc eb da", "cf be ad"};
    for (const int channels : {1, 3})
        for (int orientation = 1; orientation <= 8; ++orientation)
            EXPECT_EQ(letters_of(oriented(letters(channels), orientation)),
                      expected[orientation - 1])
                << orientation;
}

}  // namespace
}  // namespace xcalib

#include <gtest/gtest.h>

#include "xcalib/stream/tiff.hpp"

namespace xcalib {
namespace {

// A page of one or of three channels, that has no pixels.
std::string tiff(bool big, int channels, int bits, int format) {
    std::string data = big ? "MM" : "II";
    const auto put = [&](unsigned value, int size) {
        for (int i = 0; i < size; ++i)
            data += static_cast<char>(value >> (8 * (big ? size - 1 - i : i)) & 255);
    };
    put(42, 2);
    put(8, 4);
    put(2, 2);
    const int far = 8 + 2 + 2 * 12 + 4;
    for (const auto& [tag, value] : {std::pair{258, bits}, {339, format}}) {
        put(static_cast<unsigned>(tag), 2);
        put(3, 2);
        put(static_cast<unsigned>(channels), 4);
        if (channels == 1) {
            put(static_cast<unsigned>(value), 2);
            put(0, 2);
        } else {
            put(static_cast<unsigned>(far + (tag == 339 ? 2 * channels : 0)), 4);
        }
    }
    put(0, 4);
    for (const int value : {bits, format})
        for (int i = 0; channels > 1 && i < channels; ++i) put(static_cast<unsigned>(value), 2);
    return data;
}

TEST(Tiff, NamesItsPixelsAsNumpyDoes) {
    for (const bool big : {false, true})
        for (const int channels : {1, 3}) {
            EXPECT_EQ(tiff_pixel_type(tiff(big, channels, 32, 1)), "uint32");
            EXPECT_EQ(tiff_pixel_type(tiff(big, channels, 16, 2)), "int16");
            EXPECT_EQ(tiff_pixel_type(tiff(big, channels, 16, 3)), "float16");
        }
}

TEST(Tiff, SaysNothingOfWhatIsNone) {
    const std::string whole = tiff(false, 3, 32, 1);
    for (std::size_t size = 0; size < 10; ++size)
        EXPECT_EQ(tiff_pixel_type(whole.substr(0, size)), "") << size;
    for (std::size_t size = 10; size < whole.size(); ++size) tiff_pixel_type(whole.substr(0, size));
    EXPECT_EQ(tiff_pixel_type("\x89PNG and so on, but no TIFF"), "");
    EXPECT_EQ(tiff_pixel_type(tiff(false, 1, 1, 1)), "");
    EXPECT_EQ(tiff_pixel_type(tiff(false, 1, 32, 9)), "");
}

}  // namespace
}  // namespace xcalib

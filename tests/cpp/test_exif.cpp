#include <gtest/gtest.h>

#include "xcalib/footage/exif.hpp"

namespace xcalib {
namespace {

using namespace std::string_literals;

// A TIFF whose only entry says `orientation`.
std::string tiff(int orientation, bool big) {
    const char value = static_cast<char>(orientation);
    return big ? "MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0"s + value + "\0\0\0\0\0\0"s
               : "II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0"s + value + "\0\0\0\0\0\0\0"s;
}

std::string jpeg(const std::string& inside) {
    const auto length = static_cast<char>(8 + inside.size());
    return "\xff\xd8\xff\xe0\0\x04JF\xff\xe1\0"s + length + "Exif\0\0"s + inside +
           "\xff\xda\0\x02"s;
}

std::string png(const std::string& inside) {
    const auto length = static_cast<char>(inside.size());
    return "\x89PNG\r\n\x1a\n\0\0\0\x01IHDRxCRC!\0\0\0"s + length + "eXIf"s + inside + "CRC!"s +
           "\0\0\0\0IEND\xae\x42\x60\x82"s;
}

TEST(Exif, OrientationIsReadFromEveryKindOfFile) {
    for (const bool big : {false, true})
        for (int value = 1; value <= 8; ++value) {
            EXPECT_EQ(exif_orientation(tiff(value, big)), value);
            EXPECT_EQ(exif_orientation(jpeg(tiff(value, big))), value);
            EXPECT_EQ(exif_orientation(png(tiff(value, big))), value);
        }
    EXPECT_EQ(orientation_text(6), "is to be turned by 90 deg clockwise");
}

TEST(Exif, WhatIsNotSaidOrBrokenIsAsStored) {
    for (const std::string& file : {""s, "BM"s, tiff(0, false), tiff(9, true), jpeg(""), png(""),
                                    "II*\0\xff\xff\xff\xff"s, "II*\0"s})
        EXPECT_EQ(exif_orientation(file), 1);
    // Cut anywhere, a file is read no further than it goes.
    for (const std::string& whole : {tiff(6, true), jpeg(tiff(6, false)), png(tiff(6, true))})
        for (std::size_t length = 0; length < whole.size(); ++length) {
            const int found = exif_orientation(std::string(whole, 0, length));
            EXPECT_TRUE(found == 1 || found == 6);
        }
}

TEST(Exif, OnlyATiffForgetsIt) {
    for (const bool big : {false, true}) {
        std::string file = tiff(6, big);
        forget_tiff_orientation(file);
        EXPECT_EQ(file, tiff(1, big));
    }
    std::string file = jpeg(tiff(6, false));
    forget_tiff_orientation(file);
    EXPECT_EQ(exif_orientation(file), 6);
    std::string cut = tiff(6, false).substr(0, 18);
    forget_tiff_orientation(cut);
    EXPECT_EQ(cut, tiff(6, false).substr(0, 18));
}

}  // namespace
}  // namespace xcalib

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "refusal.hpp"
#include "scratch.hpp"
#include "xcalib/stream/npy.hpp"

namespace xcalib {
namespace {

using namespace testing;

std::string header(const std::string& text, int version = 1) {
    std::string out = "\x93NUMPY";
    out += static_cast<char>(version);
    out += '\0';
    for (int i = 0; i < (version == 1 ? 2 : 4); ++i)
        out += static_cast<char>(text.size() >> (8 * i) & 255);
    return out + text;
}

const std::string kHeader = "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }  \n";

std::string floats(std::initializer_list<float> values) {
    std::string out;
    for (const float value : values) {
        char bytes[4];
        std::memcpy(bytes, &value, 4);
        out.append(bytes, 4);
    }
    return out;
}

const std::string kSix = floats({1, 2, 3, 4, 5, 6});

std::vector<float> values(const std::string& data) {
    const Picture picture = parse_npy(data, "a.npy");
    EXPECT_EQ(size_text(picture.view), "3x2");
    const float* first = picture.view.row<float>(0);
    return {first, first + 6};
}

const std::vector<float> kValues = {1, 2, 3, 4, 5, 6};

TEST(Npy, IsReadInEveryVersionAndOrderOfItsKeys) {
    for (const int version : {1, 2, 3}) EXPECT_EQ(values(header(kHeader, version) + kSix), kValues);
    EXPECT_EQ(
        values(header("{\"shape\":(2,3,1),'fortran_order':False,'descr':\"f4\"}") + kSix + "more"),
        kValues);
}

TEST(Npy, IsReadColumnByColumnAndFromOtherEnds) {
    EXPECT_EQ(values(header("{'descr': '<f4', 'fortran_order': True, 'shape': (2, 3)}") +
                     floats({1, 4, 2, 5, 3, 6})),
              kValues);
    std::string swapped = kSix;
    for (std::size_t i = 0; i < swapped.size(); i += 4)
        std::reverse(swapped.begin() + static_cast<long>(i),
                     swapped.begin() + static_cast<long>(i) + 4);
    EXPECT_EQ(values(header("{'descr': '>f4', 'fortran_order': False, 'shape': (2, 3)}") + swapped),
              kValues);
}

TEST(Npy, HalvesAreExact) {
    // 1, -2, the smallest, the largest, infinity, not a number.
    const std::string halves("\x00\x3c\x00\xc0\x01\x00\xff\x7b\x00\x7c\x01\x7c", 12);
    const auto got =
        values(header("{'descr': '<f2', 'fortran_order': False, 'shape': (2, 3)}") + halves);
    EXPECT_EQ((std::vector<float>(got.begin(), got.begin() + 5)),
              (std::vector<float>{1, -2, std::ldexp(1.0f, -24), 65504, INFINITY}));
    EXPECT_TRUE(std::isnan(got[5]));
}

TEST(Npy, AnythingElseIsRefusedByName) {
    const auto said = [](const std::string& data) {
        return refusal([&] { parse_npy(data, "a.npy"); });
    };
    const std::string damaged = "a.npy: cannot decode, truncated or not a .npy array";
    for (const std::string& text :
         {std::string(""), std::string(40000, '('), "{'descr': '<f4', " + std::string(9000, '('),
          std::string("{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3)} x"),
          std::string("{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3)"),
          std::string("{'descr': '<f4', 'fortran_order': False}"),
          std::string("{'descr': '<f4', 'fortran_order': 0, 'shape': (2, 3)}"),
          std::string("{'descr': '<f4', 'fortran_order': False, 'shape': (6)}"),
          std::string("{'descr': '<f4', 'fortran_order': False, 'shape': (-2, 3)}"),
          std::string("{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), 'x': 1}"),
          std::string("{'descr': '<f4', 'descr': '<f4', 'fortran_order': False, 'shape': (2, 3)}"),
          std::string("{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (2, 3)}"),
          // 3 EiB, and more than 64 bits can count.
          std::string("{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000, 400000000)}"),
          std::string("{'descr': '<f4', 'fortran_order': False, 'shape': (99999999999, 3)}")}) {
        EXPECT_EQ(said(header(text) + kSix), damaged) << text.substr(0, 99);
        EXPECT_EQ(said(header(text, 2) + kSix), damaged) << text.substr(0, 99);
    }
    for (const int version : {0, 4, 255}) EXPECT_EQ(said(header(kHeader, version) + kSix), damaged);
    const std::string whole = header(kHeader) + kSix;
    for (std::size_t size = 0; size < whole.size(); ++size)
        EXPECT_EQ(said(whole.substr(0, size)), damaged) << size;
    const auto of = [&](const std::string& type, const std::string& shape) {
        return said(
            header("{'descr': '" + type + "', 'fortran_order': False, 'shape': " + shape + "}") +
            kSix);
    };
    EXPECT_EQ(of("<i4", "(2, 3)"), "a.npy: depth is int32, expected floats in metres");
    EXPECT_EQ(of("|u1", "(2, 3)"), "a.npy: depth is uint8, expected floats in metres");
    EXPECT_EQ(of("|b1", "(2, 3)"), "a.npy: depth is bool, expected floats in metres");
    EXPECT_TRUE(has(of("|O", "(2, 3)"), "depth is of type O"));
    EXPECT_EQ(of("<f4", "(6,)"), "a.npy: depth has shape (6,), expected one channel (h, w)");
    EXPECT_TRUE(has(of("<f4", "(2, 3, 2)"), "depth has shape (2, 3, 2)"));
    EXPECT_TRUE(has(of("<f4", "(0, 3)"), "depth has shape (0, 3)"));
    EXPECT_TRUE(has(of("<f4", "()"), "depth has shape ()"));
}

}  // namespace
}  // namespace xcalib

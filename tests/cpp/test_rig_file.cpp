#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <locale>
#include <string>
#include <system_error>

#include "refusal.hpp"
#include "scenes.hpp"
#include "xcalib/rig_file.hpp"
#include "xcalib_rig_file.h"

namespace xcalib {
namespace {

namespace fs = std::filesystem;
using namespace ::xcalib::testing;  // NOLINT: scenes.hpp, refusal.hpp

const char* const kText = R"(format: xcalib-rig
version: 1
reference:
  width: 640
  height: 480
  fx: 600
  fy: 601.5
  cx: 319.5
  cy: 239.5
  skew: 0
source:
  width: 320
  height: 256
  fx: 300
  fy: 300
  cx: 160
  cy: 128
  skew: 0.25
source_from_reference:
  quaternion_wxyz: [1, 0, 0, 0]
  translation_m: [0.1, -0.2, 0.3]
)";

class RigFile : public ::testing::Test {
   protected:
    void SetUp() override {
        folder_ = fs::temp_directory_path() /
                  ("xcalib_rig_file_" + std::to_string(::getpid()) + "_" +
                   ::testing::UnitTest::GetInstance()->current_test_info()->name());
        fs::create_directories(folder_);
        path_ = (folder_ / "rig.yaml").string();
    }
    void TearDown() override { fs::remove_all(folder_); }

    // kText with `from` replaced by `to`, written to path_.
    void write_with(const std::string& from, const std::string& to) {
        std::string text = kText;
        const std::size_t at = text.find(from);
        ASSERT_NE(at, std::string::npos) << from;
        std::ofstream(path_) << text.replace(at, from.size(), to);
    }

    std::string refusal_with(const std::string& from, const std::string& to) {
        write_with(from, to);
        const std::string message = refusal([&] { load_rig(path_); });
        EXPECT_TRUE(has(message, path_)) << "where '" << from << "' became '" << to << "'";
        EXPECT_EQ(message.find('\n'), std::string::npos) << message;
        return message;
    }

    std::string text() const {
        std::ifstream in(path_);
        return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
    }

    std::size_t files() const {
        return static_cast<std::size_t>(
            std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
    }

    fs::path folder_;
    std::string path_;
};

void expect_identical(const Rig& a, const Rig& b) {
    for (const auto& [x, y] : {std::pair{a.reference, b.reference}, {a.source, b.source}}) {
        EXPECT_EQ(x.width, y.width);
        EXPECT_EQ(x.height, y.height);
        EXPECT_EQ(x.fx, y.fx);
        EXPECT_EQ(x.fy, y.fy);
        EXPECT_EQ(x.cx, y.cx);
        EXPECT_EQ(x.cy, y.cy);
        EXPECT_EQ(x.skew, y.skew);
    }
    EXPECT_EQ(a.source_from_reference.rotation.coeffs(), b.source_from_reference.rotation.coeffs());
    EXPECT_EQ(a.t(), b.t());
}

TEST_F(RigFile, ReadsTheDocumentedFormat) {
    std::ofstream(path_) << kText;
    const Rig rig = load_rig(path_);
    EXPECT_EQ(rig.reference.width, 640);
    EXPECT_EQ(rig.reference.fy, 601.5);
    EXPECT_EQ(rig.source.height, 256);
    EXPECT_EQ(rig.source.skew, 0.25);
    EXPECT_EQ(rig.t(), Eigen::Vector3d(0.1, -0.2, 0.3));
    EXPECT_EQ(rig.R(), Eigen::Matrix3d::Identity());
}

TEST_F(RigFile, TheQuaternionIsWFirst) {
    write_with("[1, 0, 0, 0]", "[0, 0, 0, 1]");  // half a turn about z
    EXPECT_LT((load_rig(path_).R() * Eigen::Vector3d(1, 2, 3) - Eigen::Vector3d(-1, -2, 3)).norm(),
              1e-15);
}

TEST_F(RigFile, ComesBackBitByBit) {
    std::mt19937 random(1);
    for (int i = 0; i < 50; ++i) {
        Rig rig = random_rig(random, 1280, 960, 640, 512);
        rig.source_from_reference.translation.z() = std::ldexp(uniform(random, -1, 1), -40);
        save_rig(rig, path_);
        expect_identical(load_rig(path_), rig);
    }
    EXPECT_EQ(files(), 1u) << "nothing but the file is left";
}

TEST_F(RigFile, ReplacesAnOlderFile) {
    std::ofstream(path_) << "something longer than a rig file could ever be\n" << kText << kText;
    std::mt19937 random(2);
    const Rig rig = random_rig(random, 640, 480, 320, 256);
    save_rig(rig, path_);
    expect_identical(load_rig(path_), rig);
}

TEST_F(RigFile, AMissingFieldIsNamed) {
    EXPECT_TRUE(has(refusal_with("  fx: 600\n", ""), "fx"));
    EXPECT_TRUE(has(refusal_with("  skew: 0\n", ""), "skew"));
    EXPECT_TRUE(has(refusal_with("version: 1\n", ""), "version"));
    EXPECT_TRUE(has(refusal_with("  translation_m: [0.1, -0.2, 0.3]\n", ""), "translation_m"));
    EXPECT_TRUE(has(refusal_with("source_from_reference:", "pose:"), "pose"));
}

TEST_F(RigFile, AnExtraFieldIsNamed) {
    EXPECT_TRUE(has(refusal_with("version: 1\n", "version: 1\nauthor: me\n"), "author"));
    EXPECT_TRUE(has(refusal_with("  fx: 600\n", "  fx: 600\n  k1: 0.1\n"), "k1"));
}

TEST_F(RigFile, ANumberThatIsNotFiniteIsNamedWithItsValue) {
    for (const char* value : {".nan", ".inf", "-.inf", "many", "[1]", "1e999", ""}) {
        const std::string message = refusal_with("fx: 600\n", "fx: " + std::string(value) + "\n");
        EXPECT_TRUE(has(message, "fx")) << value;
        EXPECT_TRUE(has(message, "expected")) << value;
    }
    EXPECT_TRUE(has(refusal_with("[0.1, -0.2, 0.3]", "[0.1, .nan, 0.3]"), "translation_m"));
    EXPECT_TRUE(has(refusal_with("[1, 0, 0, 0]", "[1, 0, 0, .inf]"), "quaternion_wxyz"));
}

TEST_F(RigFile, AListOfTheWrongLengthIsNamedWithItsLength) {
    const std::string message = refusal_with("[0.1, -0.2, 0.3]", "[0.1, -0.2]");
    EXPECT_TRUE(has(message, "translation_m"));
    EXPECT_TRUE(has(message, "2"));
    EXPECT_TRUE(has(message, "3 numbers"));
    EXPECT_TRUE(has(refusal_with("[1, 0, 0, 0]", "1"), "quaternion_wxyz"));
}

TEST_F(RigFile, ImpossibleValuesAreNamed) {
    EXPECT_TRUE(has(refusal_with("fx: 600", "fx: -600"), "fx = -600"));
    EXPECT_TRUE(has(refusal_with("width: 640", "width: 0"), "width = 0"));
    EXPECT_TRUE(has(refusal_with("width: 640", "width: 640.5"), "width = 640.5"));
    EXPECT_TRUE(has(refusal_with("[1, 0, 0, 0]", "[0, 0, 0, 0]"), "quaternion"));
    EXPECT_TRUE(has(refusal_with("[1, 0, 0, 0]", "[2, 0, 0, 0]"), "quaternion"));
}

TEST_F(RigFile, AnotherVersionOrFormatIsNamed) {
    const std::string message = refusal_with("version: 1", "version: 3");
    EXPECT_TRUE(has(message, "version = 3, expected 1 or 2"));
    EXPECT_TRUE(has(refusal_with("xcalib-rig", "kalibr"), "kalibr"));
}

TEST_F(RigFile, WhatIsNotARigFileIsRefusedWithItsPath) {
    for (const char* text : {"", "just words", "- a\n- b\n", "{", "a: [1, 2", "\x01\x02\xff",
                             "[1]: 2\n", "format: xcalib-rig\nversion: [1]\n"}) {
        std::ofstream(path_) << text;
        const std::string message = refusal([&] { load_rig(path_); });
        EXPECT_TRUE(has(message, path_)) << "'" << text << "'";
        EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    }
}

TEST_F(RigFile, WhatCannotBeReadIsASystemErrorWithItsPath) {
    const std::string missing = (folder_ / "missing.yaml").string();
    try {
        load_rig(missing);
        ADD_FAILURE() << "read a missing file";
    } catch (const std::system_error& error) {
        EXPECT_EQ(error.code(), std::errc::no_such_file_or_directory);
        EXPECT_TRUE(has(error.what(), missing));
    }
    try {
        load_rig(folder_.string());
        ADD_FAILURE() << "read a folder";
    } catch (const std::system_error& error) {
        EXPECT_EQ(error.code(), std::errc::is_a_directory) << error.what();
        EXPECT_TRUE(has(error.what(), folder_.string()));
    }
}

TEST_F(RigFile, WhatCannotBeWrittenIsASystemErrorAndLeavesNothing) {
    std::mt19937 random(3);
    const Rig rig = random_rig(random, 640, 480, 320, 256);
    const std::string nowhere = (folder_ / "missing" / "rig.yaml").string();
    try {
        save_rig(rig, nowhere);
        ADD_FAILURE() << "wrote into a missing folder";
    } catch (const std::system_error& error) {
        EXPECT_EQ(error.code(), std::errc::no_such_file_or_directory);
        EXPECT_TRUE(has(error.what(), nowhere));
    }
    EXPECT_EQ(files(), 0u);
    EXPECT_THROW(save_rig(rig, folder_.string()), std::system_error);  // a folder of that name
    EXPECT_EQ(files(), 0u);
}

TEST_F(RigFile, ARigThatIsNotValidIsNotWritten) {
    std::mt19937 random(4);
    Rig rig = random_rig(random, 640, 480, 320, 256);
    rig.source.fx = -1;
    EXPECT_TRUE(has(refusal([&] { save_rig(rig, path_); }), "source: fx = -1"));
    EXPECT_EQ(files(), 0u);
}

// A comma for the decimal point and dots between thousands, as in much of Europe.
class Continental : public std::numpunct<char> {
   protected:
    char do_decimal_point() const override { return ','; }
    char do_thousands_sep() const override { return '.'; }
    std::string do_grouping() const override { return "\3"; }
};

TEST_F(RigFile, TheProgramsLocaleHasNoSay) {
    std::mt19937 random(5);
    Rig rig = random_rig(random, 1280, 960, 640, 512);
    rig.source_from_reference.translation.x() = 1234.5;
    const std::locale before = std::locale::global(std::locale(std::locale(), new Continental));
    try {
        save_rig(rig, path_);
        expect_identical(load_rig(path_), rig);
    } catch (const std::exception& error) {
        ADD_FAILURE() << error.what();
    }
    std::locale::global(before);
    EXPECT_EQ(refusal([&] { expect_identical(load_rig(path_), rig); }), "");
}

TEST_F(RigFile, RelativeDepthIsKeptWhereThereIsOne) {
    write_with("translation_m: [0.1, -0.2, 0.3]\n",
               "translation_m: [0.1, -0.2, 0.3]\nrelative_depth:\n  scale: 0.25\n  shift: -0.5\n");
    const Rig rig = load_rig(path_);
    ASSERT_TRUE(rig.relative_depth);
    EXPECT_EQ(rig.relative_depth->scale, 0.25);
    EXPECT_EQ(rig.relative_depth->shift, -0.5);
    save_rig(rig.resized(320, 240, 160, 128), path_);
    EXPECT_EQ(load_rig(path_).relative_depth->shift, -0.5);
    write_with("format", "relative_depth: {scale: 0, shift: 1}\nformat");
    const std::string message = refusal([&] { load_rig(path_); });
    EXPECT_TRUE(has(message, "relative_depth: scale = 0, expected a finite number > 0")) << message;
    write_with("format", "relative_depth: {scale: 1}\nformat");
    EXPECT_TRUE(has(refusal([&] { load_rig(path_); }), "missing field 'shift' in relative_depth"));
}

TEST_F(RigFile, AMirroredSourceIsKeptInVersion2) {
    write_with("version: 1", "version: 2\nsource_mirrored: true");
    const Rig rig = load_rig(path_);
    EXPECT_TRUE(rig.source_mirrored);
    save_rig(rig, path_);
    EXPECT_TRUE(load_rig(path_).source_mirrored);
    xcalib_rig in_c{};
    ASSERT_EQ(xcalib_load_rig(path_.c_str(), &in_c), XCALIB_OK);
    EXPECT_EQ(in_c.source_mirrored, 1);
    EXPECT_TRUE(has(refusal_with("version: 1", "version: 2\nsource_mirrored: perhaps"),
                    "source_mirrored = perhaps, expected true or false"));
}

TEST_F(RigFile, LensesAreKeptInVersion2) {
    std::ofstream(path_) << kText;
    Rig rig = load_rig(path_);
    rig.reference.lens = Lens(LensModel::fisheye, {0.01, -0.002, 0, 1e-5});
    rig.source.lens = Lens(LensModel::brown, {-0.367, 0.03, 0.007, 0.003, 0.1 + 0.2});
    save_rig(rig, path_);
    EXPECT_TRUE(has(text(), "version: 2\n"));
    EXPECT_TRUE(
        has(text(), "  lens:\n    model: fisheye\n    coefficients: [0.01, -0.002, 0, 1e-05]"));
    const Rig back = load_rig(path_);
    EXPECT_EQ(back.reference.lens, rig.reference.lens);
    EXPECT_EQ(back.source.lens, rig.source.lens);
    EXPECT_EQ(back.source.lens.coefficients().size(), 5u);
    rig.reference.lens = rig.source.lens = Lens();
    save_rig(rig, path_);
    EXPECT_TRUE(has(text(), "version: 1\n")) << "which older software reads";
    xcalib_rig in_c;
    save_rig(back, path_);
    ASSERT_EQ(xcalib_load_rig(path_.c_str(), &in_c), XCALIB_OK);
    EXPECT_EQ(in_c.reference.lens, XCALIB_LENS_FISHEYE);
    EXPECT_EQ(in_c.reference.lens_coefficients[3], 1e-5);
    EXPECT_EQ(in_c.source.lens, XCALIB_LENS_BROWN);
    EXPECT_EQ(in_c.source.lens_coefficients[4], 0.1 + 0.2);
    EXPECT_EQ(in_c.source.lens_coefficients[5], 0);
}

TEST_F(RigFile, ALensThatIsNoneIsNamed) {
    const auto with = [&](const std::string& lens) {
        return refusal_with("  skew: 0.25\n", "  skew: 0.25\n  lens: " + lens + "\n");
    };
    EXPECT_TRUE(has(with("{model: tele, coefficients: []}"),
                    "source.lens.model = tele, expected none, brown or fisheye"));
    EXPECT_TRUE(has(with("{model: brown, coefficients: [1, 2, 3]}"),
                    "source.lens: a lens of model "
                    "brown has 3 coefficients"));
    EXPECT_TRUE(has(with("{model: brown, coefficients: 1}"),
                    "source.lens.coefficients = 1, expected a list of numbers"));
    EXPECT_TRUE(has(with("{model: brown, coefficients: [1, 2, 3, .inf]}"), "expected a finite"));
    EXPECT_TRUE(has(with("brown"), "expected a mapping of fields in source.lens"));
}

TEST_F(RigFile, ANumberThatNoDoubleHoldsIsRefused) {
    for (const char* value : {"1e400", "-1e400", "1e-400"})
        EXPECT_TRUE(has(refusal_with("fx: 600", "fx: " + std::string(value)),
                        "reference.fx = " + std::string(value) + ", expected a finite number"));
    EXPECT_TRUE(has(refusal_with("[0.1, -0.2, 0.3]", "[0.1, 1e400, 0.3]"), "= 1e400, expected"));
    EXPECT_TRUE(has(refusal_with("width: 640", "width: 99999999999"), "width = 99999999999"));
    EXPECT_LT(refusal_with("xcalib-rig", std::string(5000, 'x')).size(), path_.size() + 150);
    // Of a number of many digits a few are quoted.
    const std::string message = refusal_with("fx: 600", "fx: x" + std::string(300, '1'));
    EXPECT_LT(message.size(), path_.size() + 150) << message;
    EXPECT_TRUE(has(message, "... (301 characters), expected a finite number"));
}

TEST_F(RigFile, IsOneDocumentWithEachKeyOnce) {
    EXPECT_TRUE(has(refusal_with("  fx: 600\n", "  fx: 600\n  fx: 601\n"),
                    "'fx' is given again in line 7, expected once"));
    EXPECT_TRUE(
        has(refusal_with("format: xcalib-rig\n", "format: xcalib-rig\nformat: xcalib-rig\n"),
            "'format' is given again"));
    EXPECT_TRUE(has(refusal_with("format", "---\na: 1\n---\nformat"), "a second document"));
    EXPECT_TRUE(has(refusal_with("fx: 600\n  fy: 601.5", "fx: &a 600\n  fy: *a"),
                    "an alias (*) in line 7"));
}

TEST_F(RigFile, IsOfBoundedSizeAndDepth) {
    EXPECT_TRUE(
        has(refusal_with("[0.1, -0.2, 0.3]", std::string(400, '[')), "nested more than 16"));
    EXPECT_TRUE(has(refusal_with("[0.1, -0.2, 0.3]", std::string(200000, '[')), "nested"));
    std::string keys;
    for (int i = 0; i < 20000; ++i) keys += "k" + std::to_string(i) + ": 1\n";
    EXPECT_TRUE(has(refusal_with("format", keys + "format"), "more than 10000 values"));
    EXPECT_TRUE(has(refusal_with("format", "#" + std::string(1 << 20, ' ') + "\nformat"),
                    "bytes, expected at most 1048576"));
}

TEST_F(RigFile, HelpsWithFieldsThatAreMissingOrUnknown) {
    EXPECT_TRUE(
        has(refusal_with("  skew: 0\n", ""),
            "missing field 'skew' in reference, expected width, height, fx, fy, cx, cy, skew"));
    EXPECT_TRUE(has(refusal_with("version: 1\n", "version: 1\nnotes: mine\n"),
                    "unknown field 'notes' in the file, expected format, version"));
    EXPECT_TRUE(has(refusal_with("width: 640", "width: 640.0"),
                    "width = 640.0, expected a whole number of px, at least 1, as in 640"));
}

TEST_F(RigFile, AQuaternionOfFewDigitsIsMadeUnit) {
    write_with("[1, 0, 0, 0]", "[0.9998, 0.02, 0, 0]");
    const Rig rig = load_rig(path_);
    EXPECT_NEAR(rig.source_from_reference.rotation.norm(), 1, 1e-15);
    EXPECT_NEAR(rig.source_from_reference.rotation.x(), 0.02, 1e-5);
    EXPECT_TRUE(has(refusal_with("[1, 0, 0, 0]", "[1.002, 0, 0, 0]"),
                    "of length 1.002, expected w, x, y, z of length 1, to within 0.001"));
}

TEST_F(RigFile, SaysWhatIsNotPlausible) {
    write_with("format", "format");
    EXPECT_TRUE(implausible(load_rig(path_)).empty());
    const auto said = [&](const std::string& from, const std::string& to) {
        write_with(from, to);
        const std::vector<std::string> lines = implausible(load_rig(path_));
        return lines.size() == 1 ? lines[0] : std::to_string(lines.size()) + " lines";
    };
    EXPECT_EQ(said("cx: 319.5", "cx: 58250"),
              "reference.cx = 58250 is not plausible: it lies far outside of the image, of 640 px");
    EXPECT_TRUE(has(said("[0.1, -0.2, 0.3]", "[127, -8, -55]"), "was it in millimetres?"));
    EXPECT_TRUE(has(said("fx: 600\n", "fx: 4.5\n"), "reference.fx = 4.5 is not plausible"));
    EXPECT_TRUE(has(said("skew: 0.25", "skew: 250"), "source.skew = 250"));
}

TEST_F(RigFile, IsAFileAndNoPipe) {
    ASSERT_EQ(mkfifo(path_.c_str(), 0600), 0);
    EXPECT_TRUE(has(refusal([&] { load_rig(path_); }), "is a pipe or a device, expected a file"));
}

TEST_F(RigFile, ReadsTheSameInC) {
    write_with("format", "format");
    xcalib_rig rig{};
    ASSERT_EQ(xcalib_load_rig(path_.c_str(), &rig), XCALIB_OK) << xcalib_last_error();
    const auto camera = [](const xcalib_camera& c) {
        return Pinhole{c.width, c.height, c.fx, c.fy, c.cx, c.cy, c.skew};
    };
    const double *q = rig.quaternion_wxyz, *t = rig.translation_m;
    const Rig in_c{camera(rig.reference),
                   camera(rig.source),
                   {Eigen::Quaterniond(q[0], q[1], q[2], q[3]), Eigen::Vector3d(t[0], t[1], t[2])}};
    expect_identical(in_c, load_rig(path_));
    EXPECT_EQ(rig.relative_depth_scale, 0);
    EXPECT_EQ(rig.relative_depth_shift, 0);
    write_with("format", "relative_depth: {scale: 0.25, shift: -0.5}\nformat");
    ASSERT_EQ(xcalib_load_rig(path_.c_str(), &rig), XCALIB_OK);
    EXPECT_EQ(rig.relative_depth_scale, 0.25);
    EXPECT_EQ(rig.relative_depth_shift, -0.5);
}

TEST_F(RigFile, WhatFailsInCHasAStatusAndAText) {
    xcalib_rig rig{};
    rig.source.width = 5;
    EXPECT_EQ(xcalib_load_rig((path_ + ".none").c_str(), &rig), XCALIB_SYSTEM_ERROR);
    EXPECT_TRUE(has(xcalib_last_error(), path_ + ".none"));
    write_with("fx: 600", "fx: -600");
    EXPECT_EQ(xcalib_load_rig(path_.c_str(), &rig), XCALIB_INVALID_ARGUMENT);
    EXPECT_TRUE(has(xcalib_last_error(), "fx = -600"));
    EXPECT_EQ(xcalib_load_rig(nullptr, &rig), XCALIB_INVALID_ARGUMENT);
    EXPECT_STREQ(xcalib_last_error(), "path is NULL");
    EXPECT_EQ(xcalib_load_rig(path_.c_str(), nullptr), XCALIB_INVALID_ARGUMENT);
    EXPECT_STREQ(xcalib_last_error(), "rig is NULL");
    EXPECT_EQ(rig.source.width, 5) << "left as it was";
}

}  // namespace
}  // namespace xcalib

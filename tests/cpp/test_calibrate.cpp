#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include "refusal.hpp"
#include "scenes.hpp"
#include "views.hpp"
#include "xcalib/calibrate.hpp"

namespace xcalib {
namespace {

using namespace ::xcalib::testing;  // NOLINT: scenes.hpp, refusal.hpp

// --- Options
// --------------------------------------------------------------------------------------

TEST(CalibrationOptions, DefaultsAreValid) { CalibrationOptions{}.validate(); }

TEST(CalibrationOptions, ValidationNamesFieldValueAndRange) {
    struct Case {
        void (*spoil)(CalibrationOptions&);
        const char* text;
    };
    const Case cases[] = {
        {[](CalibrationOptions& o) { o.max_frames = 0; }, "max_frames = 0, expected at least 1"},
        {[](CalibrationOptions& o) { o.num_threads = -2; }, "num_threads = -2, expected 0"},
        {[](CalibrationOptions& o) { o.working_width = 10; }, "working_width = 10, expected at"},
        {[](CalibrationOptions& o) { o.max_iterations = 0; }, "max_iterations = 0"},
        {[](CalibrationOptions& o) { o.prior_weight = -0.5; }, "prior_weight = -0.5"},
        {[](CalibrationOptions& o) { o.prior_weight = kNaN; }, "prior_weight = "},
        {[](CalibrationOptions& o) { o.reference_hfov_deg = 180; }, "reference_hfov_deg = 180"},
        {[](CalibrationOptions& o) { o.reference_hfov_deg = kNaN; }, "reference_hfov_deg = "},
        {[](CalibrationOptions& o) { o.reference_camera = Pinhole{}; }, "reference_camera: width"},
        {[](CalibrationOptions& o) { o.source_camera = Pinhole{}; }, "source_camera: width = 0"},
        {[](CalibrationOptions& o) { o.search.max_fov_ratio = 1; }, "search.max_fov_ratio = 1"},
        {[](CalibrationOptions& o) { o.search.max_roll_deg = -1; }, "search.max_roll_deg = -1"},
        {[](CalibrationOptions& o) { o.search.min_overlap = 1; }, "search.min_overlap = 1"},
        {[](CalibrationOptions& o) { o.search.map_width = 31; }, "search.map_width = 31"},
        {[](CalibrationOptions& o) { o.search.candidates = 0; }, "search.candidates = 0"},
    };
    for (const Case& each : cases) {
        CalibrationOptions options;
        each.spoil(options);
        EXPECT_TRUE(has(refusal([&] { options.validate(); }), each.text));
    }
}

TEST(CalibrationOptions, ANumberInAMessageIsTheNumberGiven) {
    CalibrationOptions options;
    options.prior_weight = -1e-9;
    EXPECT_TRUE(has(refusal([&] { options.validate(); }), "-1e-09"));
}

// --- Frames
// ---------------------------------------------------------------------------------------

// Two pairs that are fine; a test spoils them.
struct Footage {
    std::vector<Image> references, sources, depths;

    Footage() {
        std::mt19937 random(1);
        for (int i = 0; i < 2; ++i) {
            references.push_back(drawn(blobs(random, 64, 48, 20, 4, 0.9), 64, 48));
            sources.push_back(drawn(blobs(random, 60, 40, 20, 4, 0.9), 60, 40));
            depths.push_back(Image(32, 24, 5.0f));
        }
    }
    std::string refusal() const {
        const auto views = [](const std::vector<Image>& images) {
            std::vector<ImageView> out;
            for (const Image& image : images) out.push_back(image.view());
            return out;
        };
        return ::xcalib::testing::refusal(
            [&] { calibrate(views(references), views(sources), views(depths)); });
    }
};

TEST(Calibrate, UnequalNumbersOfFramesAreRefusedWithTheNumbers) {
    Footage footage;
    footage.sources.pop_back();
    EXPECT_TRUE(has(footage.refusal(), "2 references, 1 sources and 2 depth maps"));
    EXPECT_TRUE(has(refusal([] { calibrate({}, {}, {}); }), "expected at least 1"));
}

TEST(Calibrate, ImagesOfAnotherSizeAreRefusedByFrame) {
    Footage footage;
    footage.references[1] = Image(65, 48, 0.5f);
    EXPECT_TRUE(has(footage.refusal(), "reference frame 1 is 65x48, expected 64x48"));
    footage = {};
    footage.sources[0] = Image(16, 40, 0.5f);
    EXPECT_TRUE(has(footage.refusal(), "source frame 0 is 16x40"));
    footage = {};
    footage.depths[1] = Image(32, 32, 5.0f);
    EXPECT_TRUE(has(footage.refusal(), "depth frame 1"));
    EXPECT_TRUE(has(footage.refusal(), "32x32"));
    EXPECT_TRUE(has(footage.refusal(), "64x48"));
}

TEST(Calibrate, ConstantImagesAreRefusedByFrame) {
    Footage footage;
    footage.sources[1] = Image(60, 40, 0.25f);
    EXPECT_TRUE(has(footage.refusal(), "source frame 1: image is constant"));
    footage = {};
    footage.references[0] = Image(64, 48, 0.25f);
    EXPECT_TRUE(has(footage.refusal(), "reference frame 0: image is constant"));
}

TEST(Calibrate, ASourceWithoutAFinitePixelIsRefusedByFrame) {
    Footage footage;
    footage.sources[1] = Image(60, 40, std::numeric_limits<float>::quiet_NaN());
    EXPECT_TRUE(has(footage.refusal(), "source frame 1"));
}

TEST(Calibrate, DepthThatIsNowhereKnownIsRefusedByFrame) {
    for (const float unknown : {0.0f, -1.0f, std::numeric_limits<float>::infinity(),
                                std::numeric_limits<float>::quiet_NaN()}) {
        Footage footage;
        footage.depths[1] = Image(32, 24, unknown);
        EXPECT_TRUE(has(footage.refusal(), "depth frame 1: no depth is known"));
    }
}

TEST(Calibrate, TheSameFrameIsNamedWhateverTheNumberOfThreads) {
    Footage footage;
    footage.sources[0] = Image(60, 40, 0.25f);
    footage.sources[1] = Image(60, 40, 0.25f);
    for (int i = 0; i < 40; ++i) ASSERT_TRUE(has(footage.refusal(), "source frame 0"));
}

}  // namespace
}  // namespace xcalib

// What `register` has in common for files and for live cameras.
#pragma once

#include "console.hpp"
#include "frames.hpp"
#include "options.hpp"
#include "sink.hpp"
#include "xcalib/register.hpp"

namespace xcalib::cli {

struct RegisterArguments {
    std::string rig, output;
    FrameArguments frames;
    bool overlays = false;
    bool overwrite = false;  // begin anew where an earlier run has written
    RegistrarOptions options;
    std::string occlusion = "mark";

    // Live cameras.
    bool live = false;
    int depth_fd = -1;                  // none: --depth plane
    std::string depth_sync = "latest";  // or each
    int max_frames = 0;                 // 0: until a stream ends
    double rate = 30.0;                 // of a video that is written [1/s]
};

// Totals over a stream of registered frames.
struct Totals {
    int frames = 0;
    int earlier = 0;  // of these, that were there from an earlier run
    long valid = 0, pixels = 0;
    double seconds = 0.0;  // what the others took
};

// One frame on the reference grid.
Registered registered(const Registrar& registrar, const cv::Mat& reference, const cv::Mat& source,
                      const cv::Mat& depth, bool overlay);

// All frames that an earlier run has not written. Throws Interrupted where asked to end; what is
// written then is whole, and the same call goes on from there.
Totals register_files(const RegisterArguments& arguments, const Frames& frames, const Rig& rig,
                      Console& console);

// Until a camera or the depth ends, or Ctrl-C.
Totals register_live(const RegisterArguments& arguments, const Rig& rig, Console& console);

}  // namespace xcalib::cli

// What `register` has in common for files and for live cameras.
#pragma once

#include "console.hpp"
#include "options.hpp"
#include "xcalib/stream/register_frames.hpp"

namespace xcalib::cli {

struct RegisterArguments {
    std::string rig, output;
    FrameArguments frames;
    RegistrationOptions options;
    std::string occlusion = "mark";

    // Live cameras.
    bool live = false;
    int depth_fd = -1;                  // none: --depth plane
    std::string depth_sync = "latest";  // or each
    int max_frames = 0;                 // 0: until a stream ends
    double rate = 30.0;                 // of a video that is written [1/s]
};

// All frames that an earlier run has not written.
Registration register_files(const RegisterArguments& arguments, const Frames& frames,
                            const Rig& rig, Console& console);

// Until a camera or the depth ends, or Ctrl-C.
Registration register_live(const RegisterArguments& arguments, const Rig& rig, Console& console);

}  // namespace xcalib::cli

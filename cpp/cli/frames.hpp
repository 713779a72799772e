// Paired frames, opened but not read.
#pragma once

#include "console.hpp"
#include "depth.hpp"
#include "footage.hpp"
#include "options.hpp"
#include "xcalib/camera.hpp"

namespace xcalib::cli {

struct Frame {
    cv::Mat reference, source, depth;
};

struct Frames {
    StreamPointer references, sources;
    DepthPointer depth;

    int size() const { return references->size(); }
    Frame read(int index) const;
};

// What the arguments name; how frames were paired by time is told on the console.
Frames open_frames(const FrameArguments& arguments, const std::optional<Rig>& rig,
                   Console& console);

// The frames with false colour turned back to numbers, told on the console.
Frames with_scalar_sources(Frames frames, const std::string& colormap, Console& console);

}  // namespace xcalib::cli

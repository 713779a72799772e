// Frames as the arguments of the commands name them.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "console.hpp"
#include "options.hpp"
#include "xcalib/camera.hpp"
#include "xcalib/stream/frames.hpp"
#include "xcalib/stream/straightened.hpp"

namespace xcalib::cli {

// The console warns of what is not plausible in it.
Rig load_rig(const std::string& file, Console& console);

// Paired; the console says how, where that was by time.
Frames open_frames(const FrameArguments& arguments, const std::optional<Rig>& rig,
                   Console& console);

// The frames with false colour turned back to numbers, as the console says.
Frames with_scalar_sources(Frames frames, const std::string& colormap, Console& console);

// The files that the arguments name, besides those of the frames; empty names among them.
std::vector<std::filesystem::path> given_files(const FrameArguments& arguments,
                                               const std::string& rig);

// The readouts that the arguments give; 0 for `auto`, which is refused unless `may_be_auto`, and
// then for one camera at most.
Readout readout_of(const FrameArguments& arguments, bool may_be_auto = false);

// The frames with their sources straightened, see straightened().
Frames with_straight_rows(Frames frames, const Readout& readout, const std::optional<Rig>& rig,
                          bool nearest = false);

// What the numbers of the depth maps were taken for, once it is known that they will do.
void say_depth(const Depth& depth, Console& console);

// What a run would read, pair, choose and write; outputs without a name are none.
void say_plan(const Frames& frames, const std::vector<std::string>& outputs,
              const std::vector<int>& chosen, Console& console);

}  // namespace xcalib::cli

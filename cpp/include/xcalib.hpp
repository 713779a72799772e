// The method, from top to bottom.
#pragma once
// clang-format off
// What is estimated, and from what.
#include "xcalib/lens.hpp"    // what a lens does to a pinhole's image
#include "xcalib/camera.hpp"  // two cameras and their pose: a rig
#include "xcalib/image.hpp"   // images and depth maps

// Where a reference pixel lies in the source, and the source image on the reference grid.
#include "xcalib/warp.hpp"

// What is maximized: edges of both images that agree, and the shift that is left.
#include "xcalib/gray.hpp"
#include "xcalib/nec.hpp"
#include "xcalib/edge_map.hpp"
#include "xcalib/flow.hpp"
#include "xcalib/parameters.hpp"

// How its maximum is found: a search over every displacement, then least squares.
#include "xcalib/search.hpp"
#include "xcalib/calibration_options.hpp"
#include "xcalib/verdict.hpp"
#include "xcalib/error_field.hpp"
#include "xcalib/calibration_report.hpp"
#include "xcalib/calibrate.hpp"
#include "xcalib/verdict_on.hpp"

// What is done with the rig: kept in a file, and used on a stream of frames.
#include "xcalib/rig_file.hpp"
#include "xcalib/register.hpp"
#include "xcalib/transfer.hpp"
// clang-format on

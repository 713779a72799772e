#include <stdexcept>

#include "register/c_api.hpp"
#include "xcalib/rig_file.hpp"
#include "xcalib_rig_file.h"

namespace {

xcalib_camera camera_of(const xcalib::Pinhole& camera) {
    xcalib_camera out{camera.width, camera.height, camera.fx,        camera.fy, camera.cx,
                      camera.cy,    camera.skew,   XCALIB_LENS_NONE, {}};
    const xcalib::Lens& lens = camera.lens;
    if (lens.model() == xcalib::LensModel::brown) out.lens = XCALIB_LENS_BROWN;
    if (lens.model() == xcalib::LensModel::fisheye) out.lens = XCALIB_LENS_FISHEYE;
    for (int i = 0; i < 8; ++i) out.lens_coefficients[i] = lens.coefficient(i);
    return out;
}

}  // namespace

xcalib_status xcalib_load_rig(const char* path, xcalib_rig* rig) try {
    if (!path || !rig) throw std::invalid_argument(path ? "rig is NULL" : "path is NULL");
    const xcalib::Rig read = xcalib::load_rig(path);
    const Eigen::Quaterniond& q = read.source_from_reference.rotation;
    const xcalib::RelativeDepth relative = read.relative_depth.value_or(xcalib::RelativeDepth{0});
    *rig = {camera_of(read.reference),
            camera_of(read.source),
            {q.w(), q.x(), q.y(), q.z()},
            {read.t().x(), read.t().y(), read.t().z()},
            relative.scale,
            relative.shift,
            read.source_mirrored};
    return XCALIB_OK;
} catch (...) {
    return xcalib::status_of_exception();
}

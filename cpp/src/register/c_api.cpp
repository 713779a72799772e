#include "register/c_api.hpp"

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <stdexcept>
#include <string>
#include <system_error>

#include "xcalib/register.hpp"
#include "xcalib/transfer.hpp"

static_assert(XCALIB_U8 == static_cast<int>(xcalib::PixelType::u8) &&
              XCALIB_U16 == static_cast<int>(xcalib::PixelType::u16) &&
              XCALIB_F32 == static_cast<int>(xcalib::PixelType::f32));
static_assert(XCALIB_OCCLUSION_IGNORE == static_cast<int>(xcalib::Occlusion::ignore) &&
              XCALIB_OCCLUSION_MARK == static_cast<int>(xcalib::Occlusion::mark) &&
              XCALIB_OCCLUSION_HIDE == static_cast<int>(xcalib::Occlusion::hide));
static_assert(XCALIB_VALID == static_cast<int>(xcalib::Validity::valid) &&
              XCALIB_OUTSIDE == static_cast<int>(xcalib::Validity::outside) &&
              XCALIB_OCCLUDED == static_cast<int>(xcalib::Validity::occluded) &&
              XCALIB_NO_DEPTH == static_cast<int>(xcalib::Validity::no_depth));
static_assert(XCALIB_VALID == static_cast<int>(xcalib::Transferred::valid) &&
              XCALIB_OUTSIDE == static_cast<int>(xcalib::Transferred::outside) &&
              XCALIB_OCCLUDED == static_cast<int>(xcalib::Transferred::occluded) &&
              XCALIB_NO_DEPTH == static_cast<int>(xcalib::Transferred::no_depth) &&
              XCALIB_AMBIGUOUS == static_cast<int>(xcalib::Transferred::ambiguous));

struct xcalib_registrar {
    xcalib::Registrar registrar;
};

namespace xcalib {
namespace {

// Not a std::string: where memory has run out, it can still be said.
thread_local char last_error[501] = "";

xcalib_status failed(xcalib_status status, const char* text) noexcept {
    std::snprintf(last_error, sizeof last_error, "%s", text);
    return status;
}

[[noreturn]] void reject(const char* argument, const std::string& what) {
    throw std::invalid_argument(argument + what);
}

void require_given(const void* pointer, const char* argument) {
    if (!pointer) reject(argument, " is NULL");
}

Lens lens_of(const xcalib_camera& camera, const char* name) {
    const double* c = camera.lens_coefficients;
    switch (camera.lens) {
        case XCALIB_LENS_NONE: return {};
        case XCALIB_LENS_BROWN: return {LensModel::brown, {c, c + 8}};
        case XCALIB_LENS_FISHEYE: return {LensModel::fisheye, {c, c + 4}};
        default:
            reject(name,
                   ": lens is " + std::to_string(camera.lens) + ", expected an xcalib_lens_model");
    }
}

Pinhole camera_of(const xcalib_camera& camera, const char* name) {
    return {camera.width, camera.height, camera.fx,   camera.fy,
            camera.cx,    camera.cy,     camera.skew, lens_of(camera, name)};
}

Rig rig_of(const xcalib_rig& rig) {
    const double* q = rig.quaternion_wxyz;
    const double* t = rig.translation_m;
    return {camera_of(rig.reference, "reference"),
            camera_of(rig.source, "source"),
            {Eigen::Quaterniond(q[0], q[1], q[2], q[3]), Eigen::Vector3d(t[0], t[1], t[2])},
            std::nullopt,
            rig.source_mirrored != 0};
}

RegistrarOptions options_of(const xcalib_options& options) {
    if (options.occlusion < XCALIB_OCCLUSION_IGNORE || options.occlusion > XCALIB_OCCLUSION_HIDE)
        reject("occlusion",
               " is " + std::to_string(options.occlusion) + ", expected an xcalib_occlusion");
    return {options.num_threads, options.nearest != 0, static_cast<Occlusion>(options.occlusion),
            options.depth_scale};
}

// View is ImageView or MutableImageView, Pixels what C has for it.
template <class View, class Pixels>
View view_of(const Pixels* pixels, const char* name) {
    require_given(pixels, name);
    if (!pixels->data) reject(name, ": data is NULL");
    const auto require = [name](bool ok, const char* field, long value, const char* expected) {
        if (ok) return;
        reject(name, std::string(": ") + field + " = " + std::to_string(value) + ", expected " +
                         expected);
    };
    const int type = pixels->type;
    require(pixels->width > 0, "width", pixels->width, "at least 1 px");
    require(pixels->height > 0, "height", pixels->height, "at least 1 px");
    require(pixels->channels == 1 || pixels->channels == 3, "channels", pixels->channels, "1 or 3");
    require(type >= XCALIB_U8 && type <= XCALIB_F32, "type", type, "an xcalib_pixel_type");
    const auto value = static_cast<std::ptrdiff_t>(bytes_per_channel(static_cast<PixelType>(type)));
    const std::ptrdiff_t row = value * pixels->channels * pixels->width;
    require(std::abs(pixels->row_bytes) >= row, "row_bytes", pixels->row_bytes,
            "at least a row of pixels");
    require(pixels->row_bytes % value == 0, "row_bytes", pixels->row_bytes,
            "a multiple of a value's size");
    if (reinterpret_cast<std::uintptr_t>(pixels->data) % value != 0)
        reject(name, ": data is not aligned as its type, expected a multiple of " +
                         std::to_string(value));
    return {pixels->data,
            pixels->width,
            pixels->height,
            pixels->channels,
            static_cast<PixelType>(type),
            pixels->row_bytes};
}

// Exceptions end here.
template <class Work>
xcalib_status guarded(const Work& work) noexcept {
    try {
        work();
        return XCALIB_OK;
    } catch (...) {
        return status_of_exception();
    }
}

}  // namespace

xcalib_status status_of_exception() noexcept {
    try {
        throw;
    } catch (const std::invalid_argument& error) {
        return failed(XCALIB_INVALID_ARGUMENT, error.what());
    } catch (const std::bad_alloc&) {
        return failed(XCALIB_OUT_OF_MEMORY, "out of memory");
    } catch (const std::system_error& error) {
        return failed(XCALIB_SYSTEM_ERROR, error.what());
    } catch (const std::exception& error) {
        return failed(XCALIB_INTERNAL_ERROR, error.what());
    } catch (...) {
        return failed(XCALIB_INTERNAL_ERROR, "unknown exception");
    }
}

}  // namespace xcalib

const char* xcalib_version(void) { return XCALIB_VERSION; }

const char* xcalib_last_error(void) { return xcalib::last_error; }

xcalib_options xcalib_default_options(void) {
    const xcalib::RegistrarOptions options;
    return {options.num_threads, options.nearest, static_cast<int>(options.occlusion),
            options.depth_scale};
}

xcalib_status xcalib_create(const xcalib_rig* rig, const xcalib_options* options,
                            xcalib_registrar** registrar) {
    using namespace xcalib;
    if (registrar) *registrar = nullptr;
    return guarded([&] {
        require_given(registrar, "registrar");
        require_given(rig, "rig");
        *registrar = new xcalib_registrar{
            Registrar(rig_of(*rig), options ? options_of(*options) : RegistrarOptions())};
    });
}

void xcalib_destroy(xcalib_registrar* registrar) { delete registrar; }

xcalib_status xcalib_register(const xcalib_registrar* registrar, const xcalib_image* source,
                              const xcalib_image* depth, const xcalib_output* registered,
                              uint8_t* mask) {
    using namespace xcalib;
    return guarded([&] {
        require_given(registrar, "registrar");
        require_given(mask, "mask");
        registrar->registrar.register_frame(
            view_of<ImageView>(source, "source"), view_of<ImageView>(depth, "depth"),
            view_of<MutableImageView>(registered, "registered"), mask);
    });
}

xcalib_status xcalib_map(const xcalib_registrar* registrar, const xcalib_image* depth, float* map) {
    using namespace xcalib;
    return guarded([&] {
        require_given(registrar, "registrar");
        require_given(map, "map");
        registrar->registrar.map(view_of<ImageView>(depth, "depth"), map);
    });
}

namespace {

using OneWay = xcalib::TransferredPoint (xcalib::FrameTransfer::*)(const Eigen::Vector2d&) const;

xcalib_status transferred(OneWay way, const xcalib_rig* rig, const xcalib_image* depth,
                          const double* points, size_t count, double* out, uint8_t* codes) {
    using namespace xcalib;
    return guarded([&] {
        require_given(rig, "rig");
        require_given(points, "points");
        require_given(out, "out");
        require_given(codes, "codes");
        const FrameTransfer frame(rig_of(*rig), view_of<ImageView>(depth, "depth"));
        for (size_t i = 0; i < count; ++i) {
            const TransferredPoint p = (frame.*way)({points[2 * i], points[2 * i + 1]});
            out[2 * i] = p.point.x();
            out[2 * i + 1] = p.point.y();
            codes[i] = static_cast<uint8_t>(p.code);
        }
    });
}

}  // namespace

xcalib_status xcalib_transfer(const xcalib_rig* rig, const xcalib_image* depth,
                              const double* points, size_t count, double* out, uint8_t* codes) {
    return transferred(&xcalib::FrameTransfer::to_source, rig, depth, points, count, out, codes);
}

xcalib_status xcalib_transfer_back(const xcalib_rig* rig, const xcalib_image* depth,
                                   const double* points, size_t count, double* out,
                                   uint8_t* codes) {
    return transferred(&xcalib::FrameTransfer::to_reference, rig, depth, points, count, out, codes);
}

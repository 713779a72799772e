/* The registrar in C: for firmware, and for languages that call C. Link xcalib_register.
 *
 * A rig is given by its numbers, or read from a file (xcalib_rig_file.h). All buffers are the
 * caller's. Functions that can fail return a status; xcalib_last_error() says what was wrong.
 * Conventions: pixel centres at integer coordinates, x right, y down, camera z forward; metres. */
#ifndef XCALIB_H
#define XCALIB_H

#include <stddef.h>
#include <stdint.h>

#define XCALIB_C_API __attribute__((visibility("default")))

#ifdef __cplusplus
extern "C" {
#endif

/* Of the library that is linked, "major.minor.patch". */
XCALIB_C_API const char* xcalib_version(void);

typedef enum xcalib_status {
    XCALIB_OK = 0,
    XCALIB_INVALID_ARGUMENT = 1, /* a value, or a file's content */
    XCALIB_OUT_OF_MEMORY = 2,
    XCALIB_SYSTEM_ERROR = 3, /* a file that cannot be read */
    XCALIB_INTERNAL_ERROR = 4
} xcalib_status;

/* What the last call of this thread that failed had to say: the argument, its value and what was
 * expected. Holds until the next one fails; cut off where it is longer than 500 characters. */
XCALIB_C_API const char* xcalib_last_error(void);

/* OpenCV's models; coefficients that are not given are 0. */
typedef enum xcalib_lens_model {
    XCALIB_LENS_NONE = 0,
    XCALIB_LENS_BROWN = 1,  /* k1 k2 p1 p2 k3 k4 k5 k6 */
    XCALIB_LENS_FISHEYE = 2 /* k1 k2 k3 k4 */
} xcalib_lens_model;

/* A camera: u = fx x + skew y + cx, v = fy y + cy [px], where its lens shows (X/Z, Y/Z) at (x, y).
 */
typedef struct xcalib_camera {
    int width, height;
    double fx, fy, cx, cy, skew;
    int lens; /* an xcalib_lens_model */
    double lens_coefficients[8];
} xcalib_camera;

/* Two cameras fixed to each other; the source is registered to the reference. */
typedef struct xcalib_rig {
    xcalib_camera reference, source;
    double quaternion_wxyz[4]; /* of unit norm; takes points of the reference to the source */
    double translation_m[3];   /* x_source = R x_reference + t */
    /* Of rigs calibrated on relative inverse depth r: metres are 1 / (scale r + shift), which is
     * the caller's to compute. 0 and 0 where depth is metric. */
    double relative_depth_scale, relative_depth_shift;
    int source_mirrored; /* not 0: the source image is a mirror image */
} xcalib_rig;

/* Reference pixels that the source camera sees something nearer in front of. */
typedef enum xcalib_occlusion {
    XCALIB_OCCLUSION_IGNORE = 0, /* are not looked for */
    XCALIB_OCCLUSION_MARK = 1,   /* the mask marks them; the image shows what is in front */
    XCALIB_OCCLUSION_HIDE = 2    /* are 0 in the image too, and NaN in the map */
} xcalib_occlusion;

typedef struct xcalib_options {
    int num_threads;    /* with the caller's; 0 uses every core */
    int nearest;        /* nonzero: take the pixel next to the point as it is, not a mean of four */
    int occlusion;      /* an xcalib_occlusion */
    double depth_scale; /* metres per unit of uint16 depth; 0 refuses it */
} xcalib_options;

/* Every core, bilinear, XCALIB_OCCLUSION_MARK, no uint16 depth. */
XCALIB_C_API xcalib_options xcalib_default_options(void);

typedef enum xcalib_pixel_type { XCALIB_U8 = 0, XCALIB_U16 = 1, XCALIB_F32 = 2 } xcalib_pixel_type;

/* Pixels to read. Rows may lie any way apart, upwards (row_bytes < 0) too. */
typedef struct xcalib_image {
    const void* data; /* first pixel of the top row, aligned as its type */
    int width, height;
    int channels;        /* 1 or 3, interleaved */
    int type;            /* an xcalib_pixel_type */
    ptrdiff_t row_bytes; /* from one row to the next */
} xcalib_image;

/* Pixels to write. */
typedef struct xcalib_output {
    void* data;
    int width, height;
    int channels;
    int type; /* an xcalib_pixel_type */
    ptrdiff_t row_bytes;
} xcalib_output;

/* Codes of the mask. */
enum { XCALIB_VALID = 0, XCALIB_OUTSIDE = 1, XCALIB_OCCLUDED = 2, XCALIB_NO_DEPTH = 3 };

/* One rig and a stream of frames: its threads, and its buffers. */
typedef struct xcalib_registrar xcalib_registrar;

/* `options`: NULL for the default ones. On failure `*registrar` is NULL. */
XCALIB_C_API xcalib_status xcalib_create(const xcalib_rig* rig, const xcalib_options* options,
                                         xcalib_registrar** registrar);

/* NULL is let pass. No call on the registrar may be under way. */
XCALIB_C_API void xcalib_destroy(xcalib_registrar* registrar);

/* Samples `source` on the reference's grid. `depth`: one channel, XCALIB_F32 [m] or XCALIB_U16 (see
 * depth_scale), 0 unknown, of the reference's size, or of its aspect. `registered`: the reference's
 * size, the source's type and channels. `mask`: width * height codes of the reference, without
 * gaps. Pixels that are not valid are 0, but for those that are only marked as occluded.
 *
 * Nothing is allocated but for the first depth of another size than those before.
 * Several threads may call it at once. */
XCALIB_C_API xcalib_status xcalib_register(const xcalib_registrar* registrar,
                                           const xcalib_image* source, const xcalib_image* depth,
                                           const xcalib_output* registered, uint8_t* mask);

/* Source coordinates of each reference pixel, x then y, 2 * width * height floats [px]; NaN where
 * there is none. */
XCALIB_C_API xcalib_status xcalib_map(const xcalib_registrar* registrar, const xcalib_image* depth,
                                      float* map);

/* What became of a transferred point: as in a mask, and XCALIB_AMBIGUOUS: between a near and a far
 * surface, it belongs to neither. */
enum { XCALIB_AMBIGUOUS = 4 };

/* `count` points of the reference image, x then y, in the source image, through the depth of the
 * frame: one channel, XCALIB_F32 [m]. `out`: as many, NaN where there is none, and beyond the image
 * where they lie outside; `codes`: one a point. An occluded point is given. */
XCALIB_C_API xcalib_status xcalib_transfer(const xcalib_rig* rig, const xcalib_image* depth,
                                           const double* points, size_t count, double* out,
                                           uint8_t* codes);

/* Points of the source image in the reference: of what is in front. */
XCALIB_C_API xcalib_status xcalib_transfer_back(const xcalib_rig* rig, const xcalib_image* depth,
                                                const double* points, size_t count, double* out,
                                                uint8_t* codes);

#ifdef __cplusplus
}
#endif

#endif

/* One frame through the C interface: two cameras side by side before a wall with a box, the thermal
 * one with 16-bit counts. Prints what became of the pixels. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <xcalib.h>

enum { WIDTH = 320, HEIGHT = 240, SOURCE_WIDTH = 160, SOURCE_HEIGHT = 120 };

static uint16_t source[SOURCE_HEIGHT][SOURCE_WIDTH];
static float depth[HEIGHT][WIDTH]; /* [m] */
static uint16_t registered[HEIGHT][WIDTH];
static uint8_t mask[HEIGHT][WIDTH];
static float map[HEIGHT][WIDTH][2];

static int failed(const char* what) {
    fprintf(stderr, "%s: %s\n", what, xcalib_last_error());
    return EXIT_FAILURE;
}

int main(void) {
    xcalib_rig rig;
    xcalib_options options = xcalib_default_options();
    xcalib_registrar* registrar = NULL;
    const xcalib_camera reference = {WIDTH, HEIGHT,           300, 300, 159.5, 119.5,
                                     0,     XCALIB_LENS_NONE, {0}};
    const xcalib_camera thermal = {
        SOURCE_WIDTH, SOURCE_HEIGHT, 150, 150, 79.5, 59.5, 0, XCALIB_LENS_NONE, {0}};
    const xcalib_image source_image = {source, SOURCE_WIDTH, SOURCE_HEIGHT,
                                       1,      XCALIB_U16,   sizeof source[0]};
    const xcalib_image depth_image = {depth, WIDTH, HEIGHT, 1, XCALIB_F32, sizeof depth[0]};
    const xcalib_output output = {registered, WIDTH, HEIGHT, 1, XCALIB_U16, sizeof registered[0]};
    int counts[4] = {0, 0, 0, 0};
    int x, y;

    memset(&rig, 0, sizeof rig);
    rig.reference = reference;
    rig.source = thermal;
    rig.quaternion_wxyz[0] = 1;  /* both look the same way */
    rig.translation_m[0] = -0.2; /* the thermal camera is 20 cm to the right */

    for (y = 0; y < SOURCE_HEIGHT; ++y)
        for (x = 0; x < SOURCE_WIDTH; ++x) source[y][x] = (uint16_t)(7000 + 10 * x + y);
    for (y = 0; y < HEIGHT; ++y)
        for (x = 0; x < WIDTH; ++x)
            depth[y][x] = x >= 140 && x < 180 && y >= 80 && y < 160 ? 2.0f : 10.0f;

    options.num_threads = 1;
    if (xcalib_create(&rig, &options, &registrar) != XCALIB_OK) return failed("xcalib_create");
    /* In a stream: the same calls for every frame. */
    if (xcalib_register(registrar, &source_image, &depth_image, &output, &mask[0][0]) != XCALIB_OK)
        return failed("xcalib_register");
    if (xcalib_map(registrar, &depth_image, &map[0][0][0]) != XCALIB_OK)
        return failed("xcalib_map");
    xcalib_destroy(registrar);

    for (y = 0; y < HEIGHT; ++y)
        for (x = 0; x < WIDTH; ++x) ++counts[mask[y][x]];
    printf("XCalib %s: %d valid, %d outside, %d occluded, %d without depth\n", xcalib_version(),
           counts[XCALIB_VALID], counts[XCALIB_OUTSIDE], counts[XCALIB_OCCLUDED],
           counts[XCALIB_NO_DEPTH]);

    /* By hand: x_source = 150 ((160 - 159.5) / 300 + -0.2 / 2) + 79.5. */
    printf("the box's pixel (160, 120) is at (%.2f, %.2f) of the source: %u counts\n",
           map[120][160][0], map[120][160][1], registered[120][160]);
    return fabs(map[120][160][0] - 64.75) < 1e-3 && registered[120][160] == 7707 ? EXIT_SUCCESS
                                                                                 : EXIT_FAILURE;
}

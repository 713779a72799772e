/* Rig files in C. Link xcalib_rig_file, which reads them with yaml-cpp. */
#ifndef XCALIB_RIG_FILE_H
#define XCALIB_RIG_FILE_H

#include "xcalib.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Reads what `xcalib calibrate` wrote. On failure `*rig` is left as it is. */
XCALIB_C_API xcalib_status xcalib_load_rig(const char* path, xcalib_rig* rig);

#ifdef __cplusplus
}
#endif

#endif

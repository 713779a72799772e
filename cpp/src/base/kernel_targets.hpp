// Before Highway: for which instruction sets the loops are compiled.
#pragma once

// Vectors whose size is not known to the compiler cannot stand in a struct.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)

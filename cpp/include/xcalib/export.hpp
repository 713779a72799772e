// What a public header declares is what a shared library exports: all else is hidden.
#pragma once

#define XCALIB_EXPORT [[gnu::visibility("default")]]

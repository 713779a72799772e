#!/bin/sh
# pkg_config.sh PREFIX LIBDIR SOURCE COMPILER [EMULATOR...]: builds a C program as one does without
# CMake, strictly, and runs it.
set -eu
prefix=$1 libdir=$2 source=$3 compiler=$4
shift 4
export PKG_CONFIG_PATH="$prefix/$libdir/pkgconfig"
pkg-config --print-errors --exists xcalib_register
# shellcheck disable=SC2046 # a list of words
"$compiler" -std=c99 -Wall -Wextra -pedantic -Werror "$source" -o pkg_config_program \
    $(pkg-config --cflags --libs xcalib_register) -lm -Wl,-rpath,"$prefix/$libdir"
"$@" ./pkg_config_program

#!/bin/sh
# links_little.sh LIBRARY READELF NM: fails where the streaming library refers to what only
# calibration, or rig files, need.
set -eu
library=$1 readelf=$2 nm=$3
heavy='opencv|ceres|yaml|glog|cholmod|blas|lapack|N2cv|N5ceres|N4YAML'
case $library in
*.a) needs=$("$nm" --undefined-only "$library") ;;
*) needs=$("$readelf" --dynamic "$library" | grep NEEDED) ;;
esac
[ -n "$needs" ]
! printf '%s\n' "$needs" | grep -iE "$heavy"

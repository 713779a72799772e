#!/bin/bash
# The libraries that the wheel links statically, from Debian's source packages: wheel_libraries.sh FOLDER
#
# OpenCV's core and imgproc alone, Ceres without SuiteSparse (whose licence is in part the GPL) and with its own small
# logger, yaml-cpp and Highway. What is built is kept: FOLDER/lib, and the licences in FOLDER/share/licences.
set -euo pipefail

folder=$(mkdir -p "$1" && cd "$1" && pwd)
mkdir -p "$folder"/{lists/partial,archives,source}
suite=bookworm  # whatever runs this: one set of versions
echo "deb-src http://deb.debian.org/debian $suite main" > "$folder/sources.list"
apt=(apt-get -q -o "Dir::Etc::sourcelist=$folder/sources.list" -o Dir::Etc::sourceparts=- -o "Dir::State::lists=$folder/lists"
    -o APT::Get::List-Cleanup=0)

sources() { # of a package, unpacked and patched, once
    [ -d "$folder/source/$1" ] && return
    (cd "$folder/archives" && "${apt[@]}" source --download-only "$1")
    dpkg-source --no-check -x "$folder"/archives/"$1"_*.dsc "$folder/source/$1"
}

build() { # package, CMake's options
    [ -e "$folder/source/$1.installed" ] && return
    sources "$1"
    cmake -S "$folder/source/$1" -B "$folder/build/$1" -G Ninja -DCMAKE_BUILD_TYPE=Release -DBUILD_SHARED_LIBS=OFF \
        -DCMAKE_POSITION_INDEPENDENT_CODE=ON -DCMAKE_CXX_VISIBILITY_PRESET=hidden -DCMAKE_INSTALL_PREFIX="$folder" \
        -DCMAKE_INSTALL_LIBDIR=lib -DCMAKE_POLICY_DEFAULT_CMP0063=NEW -DBUILD_TESTING=OFF "${@:2}"
    cmake --build "$folder/build/$1"
    cmake --install "$folder/build/$1" > /dev/null
    install -D -m 644 "$folder/source/$1/debian/copyright" "$folder/share/licences/$1.txt"
    touch "$folder/source/$1.installed"
    rm -rf "$folder/build/$1"
}

"${apt[@]}" update
build yaml-cpp -DYAML_CPP_BUILD_TESTS=OFF -DYAML_CPP_BUILD_TOOLS=OFF
build highway -DHWY_ENABLE_TESTS=OFF -DHWY_ENABLE_EXAMPLES=OFF -DHWY_ENABLE_CONTRIB=OFF
mkdir -p "$folder/include/hwy/contrib"  # of which headers are enough
cp -r "$folder/source/highway/hwy/contrib/math" "$folder/include/hwy/contrib"
build ceres-solver -DMINIGLOG=ON -DMINIGLOG_MAX_LOG_LEVEL=-2 -DGFLAGS=OFF -DCUDA=OFF -DSUITESPARSE=OFF -DCXSPARSE=OFF -DLAPACK=OFF -DBUILD_EXAMPLES=OFF \
    -DBUILD_BENCHMARKS=OFF -DSCHUR_SPECIALIZATIONS=OFF -DEIGENSPARSE=ON
build opencv -DBUILD_LIST=core,imgproc -DBUILD_TESTS=OFF -DBUILD_PERF_TESTS=OFF -DBUILD_opencv_apps=OFF \
    -DBUILD_JAVA=OFF -DBUILD_opencv_python3=OFF -DOPENCV_GENERATE_PKGCONFIG=OFF -DBUILD_ZLIB=OFF -DWITH_PROTOBUF=OFF \
    -DWITH_IPP=OFF -DWITH_ITT=OFF -DWITH_OPENCL=OFF -DWITH_TBB=OFF -DWITH_LAPACK=OFF -DWITH_EIGEN=OFF -DWITH_VA=OFF \
    -DWITH_GTK=OFF -DWITH_FFMPEG=OFF -DWITH_GSTREAMER=OFF -DWITH_ADE=OFF -DWITH_QUIRC=OFF -DWITH_V4L=OFF -DWITH_1394=OFF \
    -DWITH_JPEG=OFF -DWITH_PNG=OFF -DWITH_TIFF=OFF -DWITH_WEBP=OFF -DWITH_OPENJPEG=OFF -DWITH_JASPER=OFF -DWITH_OPENEXR=OFF \
    -DWITH_IMGCODEC_HDR=OFF -DWITH_IMGCODEC_SUNRASTER=OFF -DWITH_IMGCODEC_PXM=OFF -DWITH_IMGCODEC_PFM=OFF \
    -DZLIB_LIBRARY=/usr/lib/$(uname -m)-linux-gnu/libz.a -DENABLE_PRECOMPILED_HEADERS=OFF "-DCPU_DISPATCH=SSE4_1;AVX2;AVX512_SKX"

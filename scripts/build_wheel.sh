#!/bin/bash
# A wheel that needs none of Debian's libraries: build_wheel.sh PYTHON LIBRARIES OUT
#
# PYTHON has what the build requires, auditwheel and wheel; LIBRARIES is what wheel_libraries.sh made; OUT gets the wheel,
# with the licences of all that is in it.
set -euo pipefail

python=$1 libraries=$(realpath "$2") out=$(mkdir -p "$3" && realpath "$3")
cd "$(dirname "$0")/.."
tag=$("$python" -c 'import sysconfig; print(sysconfig.get_config_var("SOABI"))')
work=build/portable/$tag
rm -rf "$work/raw" "$work/unpacked" "$work/whole"
CMAKE_PREFIX_PATH=$libraries "$python" -m pip --disable-pip-version-check wheel -q . --no-build-isolation --no-deps -w "$work/raw" \
    --config-settings=build-dir="$work/cmake" \
    --config-settings=cmake.define.ZLIB_USE_STATIC_LIBS=ON
"$python" -m wheel unpack -d "$work/unpacked" "$work"/raw/*.whl
licences=$(echo "$work"/unpacked/*/*.dist-info/licenses)
cp "$libraries"/share/licences/* "$licences"
for package in libeigen3-dev nlohmann-json3-dev zlib1g-dev; do
    cp "/usr/share/doc/$package/copyright" "$licences/$package.txt"
done
cp "$("$python" -c 'import importlib.metadata as m
print(*(f.locate() for f in m.files("pybind11") if f.name == "LICENSE"))')" "$licences/pybind11.txt"
"$python" -m wheel pack -d "$work" "$work"/unpacked/*
# Refuses what is not in every Linux of that age, and would copy what is linked: of Debian's own libraries nothing may be.
PATH=$(dirname "$python"):$PATH "$python" -m auditwheel repair --plat auto --only-plat -w "$work/whole" "$work"/*.whl
rm "$work"/*.whl
if "$python" -m zipfile -l "$work"/whole/*.whl | grep -E '\.libs/'; then
    echo "error: the wheel carries the libraries above, expected all to be linked statically" >&2
    exit 1
fi
size=$(stat -c %s "$work"/whole/*.whl)
if ((size > 15000000)); then
    echo "error: the wheel has $size bytes, expected 15 MB at most" >&2
    exit 1
fi
mv "$work"/whole/*.whl "$out"
ls -l "$out"

#!/bin/bash
# Installs a wheel into a bare Debian with nothing but Python, and runs the demo there: try_wheel.sh SUITE FOLDER PYTHON
#
# SUITE: bookworm, trixie. FOLDER: of wheels. PYTHON: an interpreter with pip, which gets what the wheel requires from PyPI.
# As root, since it makes a root of its own in build/roots.
set -euo pipefail

suite=$1 wheels=$(realpath "$2") python=$(realpath -s "$3")
cd "$(dirname "$0")/.."
root=build/roots/$suite
if [ ! -e "$root/usr/bin/python3" ]; then
    rm -rf "$root"
    debootstrap --variant=minbase --include=python3 "$suite" "$root" > /dev/null
fi
version=$(chroot "$root" python3 -c 'import sys; print("%d.%d" % sys.version_info[:2])')
rm -rf "$root/opt/site" "$root/demo"
glibc=$(chroot "$root" ldd --version | sed -n '1s/.*2\.//p')
platforms=(--platform "manylinux2014_$(uname -m)")
for ((minor = 17; minor <= glibc; ++minor)); do platforms+=(--platform "manylinux_2_${minor}_$(uname -m)"); done
"$python" -m pip --disable-pip-version-check install -q --target "$root/opt/site" --python-version "$version" \
    --implementation cp --only-binary=:all: "${platforms[@]}" "$wheels"/xcalib_rgbt-*-cp"${version/./}"-*.whl
for needed in libopencv libceres libyaml-cpp libhwy; do
    ! chroot "$root" ldconfig -p | grep "$needed"
done
chroot "$root" env PYTHONPATH=/opt/site python3 -m xcalib demo -o /demo
echo "$suite, Python $version: imports, calibrates and registers"

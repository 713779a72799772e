#!/bin/bash
# Installs those of the named Debian packages that are missing; where it can't, says which they are.
set -euo pipefail

missing=()
for package in "$@"; do
    status=$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null || true)
    [[ $status == installed ]] || missing+=("$package")
done
[[ ${#missing[@]} -gt 0 ]] || exit 0

can_sudo() { command -v sudo >/dev/null && { [[ -t 0 ]] || sudo -n true 2>/dev/null; }; }

if ! command -v apt-get >/dev/null; then
    echo "error: no apt-get here; install what these Debian packages hold: ${missing[*]}" >&2
    exit 1
elif [[ $(id -u) -eq 0 ]]; then
    as_root=(env)
elif can_sudo; then
    as_root=(sudo env)
else
    echo "error: neither root nor sudo; as root, run: apt-get install ${missing[*]}" >&2
    exit 1
fi

echo "installing Debian packages: ${missing[*]}"
as_root+=(DEBIAN_FRONTEND=noninteractive apt-get -q -o Acquire::Retries=3 -o Dpkg::Use-Pty=0)
"${as_root[@]}" update </dev/null
"${as_root[@]}" install -y --no-install-recommends "${missing[@]}" </dev/null >/dev/null ||
    { echo "error: apt-get could not install ${missing[*]}" >&2; exit 1; }

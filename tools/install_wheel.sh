#!/bin/sh
# Installs a foldcar wheel into a new virtual environment at DIR, with the versions of the lock.
#
# Usage: install_wheel.sh WHEEL DIR [EXTRAS]     e.g. install_wheel.sh dist/foldcar-….whl /opt/foldcar '[mujoco]'
set -eu
project=$(cd "$(dirname "$0")/.." && pwd)
"${PYTHON:-python3}" -m venv "$2"
# A lock with hashes would refuse the wheel, which has none there.
constraints=$(mktemp)
trap 'rm -f "$constraints"' EXIT
sed -n 's/^\([a-z0-9].*[^ \\]\) *\\$/\1/p' "$project/host/requirements.txt" >"$constraints"
"$2/bin/pip" install --quiet --disable-pip-version-check --constraint "$constraints" "$1${3:-}"
"$2/bin/foldcar" --version

#!/bin/sh
# Installs a foldcar wheel, with the system's libraries and the versions of the lock, into a new virtual environment DIR.
#
# Usage: install_wheel.sh WHEEL DIR [EXTRAS]     e.g. install_wheel.sh dist/foldcar-….whl /opt/foldcar '[all]'
set -eu
project=$(cd "$(dirname "$0")/.." && pwd)
"$project/tools/install_system_packages.sh" run
"${PYTHON:-/usr/bin/python3}" -m venv "$2"
# A lock with hashes would refuse the wheel, which has none there.
constraints=$(mktemp)
trap 'rm -f "$constraints"' EXIT
sed -n 's/^\([a-z0-9].*[^ \\]\) *\\$/\1/p' "$project/host/requirements.txt" "$project/host/requirements-dev.txt" >"$constraints"
"$2/bin/pip" install --quiet --disable-pip-version-check --constraint "$constraints" "$1${3:-}"
"$2/bin/foldcar" --version

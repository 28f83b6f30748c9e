#!/bin/sh
# Builds the archive of the sources and, from nothing but that archive, the wheel with carsim and the one for every system; all
# go to the folder DIR.
# auditwheel gives the wheel the tag of the oldest systems that it runs on, and refuses one that loads foreign libraries.
#
# Usage: build_wheel.sh DIR      after `make .venv/installed .pio/release/installed`, which `make wheel` sees to
set -eu
project=$(cd "$(dirname "$0")/.." && pwd)
mkdir -p "$1"
out=$(cd "$1" && pwd)
cd "$project"

# What the lock names builds, not what a package index has today. The core folder is shared, if it was seeded.
export PATH="$project/.venv/bin:$project/.pio/release/bin:$PATH"
[ ! -f platformio.local.ini ] || export PLATFORMIO_CORE_DIR="${PLATFORMIO_CORE_DIR:-$project/.pio-core}"
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
.venv/bin/python -m build --no-isolation --outdir "$scratch" .
rm -f "$out"/foldcar-*.whl "$out"/foldcar-*.tar.gz
# MuJoCo's library is the package mujoco's, not the wheel's (`foldcar[mujoco]`).
# For systems without a native simulator: carsim.wasm and Node.
FOLDCAR_WHEEL=any .venv/bin/python -m pip wheel --no-deps --no-build-isolation --wheel-dir "$scratch/any" "$scratch"/foldcar-*.tar.gz
auditwheel repair --exclude 'libmujoco.so.*' --wheel-dir "$out" "$scratch"/foldcar-*.whl
mv "$scratch"/foldcar-*.tar.gz "$scratch"/any/foldcar-*.whl "$out"
ls -l "$out"

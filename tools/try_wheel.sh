#!/bin/sh
# Tries a wheel as a user has it: installed in an empty environment, outside the checkout, with no compiler on the PATH.
#
# Usage: try_wheel.sh WHEEL
set -eu
tools=$(cd "$(dirname "$0")" && pwd)
wheel=$(cd "$(dirname "$1")" && pwd)/$(basename "$1")
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
"$tools/install_wheel.sh" "$wheel" "$scratch/venv"
echo "without extras: $(du -sm "$scratch/venv" | cut -f 1) MB"
# Only what the scripts here call.
mkdir "$scratch/bin"
for word in cat dirname head kill mktemp rm sh sleep test; do
  ln -s "$(command -v "$word" || echo /bin/"$word")" "$scratch/bin/$word"
done
cd "$scratch"
# The core first, then what the extras add.
env -i HOME="$scratch" PATH="$scratch/bin" LC_ALL=C.UTF-8 "$tools/smoke.sh" "$scratch/venv/bin/foldcar" core
cd "$tools"
"$tools/install_wheel.sh" "$wheel" "$scratch/venv" '[all]'
echo "with extras: $(du -sm "$scratch/venv" | cut -f 1) MB"
cd "$scratch"
env -i HOME="$scratch" PATH="$scratch/bin" LC_ALL=C.UTF-8 "$tools/smoke.sh" "$scratch/venv/bin/foldcar"

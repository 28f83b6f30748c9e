#!/bin/sh
# Uses an installed foldcar as its first user does: a new project, its sweep, report, sheets and simulated car.
#
# Usage: smoke.sh FOLDCAR [core]     a program, which with `core` has no extras; everything is made in a temporary folder, outside any checkout
set -eu
foldcar=$1
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
car='--set width=115 --set radius=60'

"$foldcar" new yard
cd yard
"$foldcar" sweep study.json --store study.db --jobs 2 --realities 200
"$foldcar" report study.db -o report
test -s report/index.html
if [ "${2:-}" = core ]; then
  # shellcheck disable=SC2086  # words
  ! "$foldcar" pattern study.json --vehicle mine $car -o car 2>missing || exit 1
  while read -r line; do
    case $line in *"pip install 'foldcar[fabricate]'") ;; *) echo "smoke: $line" >&2; exit 1 ;; esac
  done <missing
  test -s missing && test ! -e car
  echo "smoke: $foldcar made a project, swept it, reported, and named the extra that it lacks"
  exit
fi
# shellcheck disable=SC2086  # words
"$foldcar" pattern study.json --vehicle mine $car -o car
test -s car/pattern.json

# A car on a pseudo-terminal, asked for one of its parameters by another process.
# shellcheck disable=SC2086
"$foldcar" link study.json --experiment yard $car >port 2>link.log &
link=$!
trap 'kill "$link" 2>/dev/null || true; rm -rf "$folder"' EXIT
tries=0
until [ -s port ]; do
  kill -0 "$link" 2>/dev/null && [ "$tries" -lt 120 ] || { cat link.log >&2; exit 1; }
  tries=$((tries + 1))
  sleep 0.5
done
"$foldcar" params get WHEEL_RADIUS_M --port "$(head -n 1 port)"
kill "$link"
wait "$link" || true
echo "smoke: $foldcar made a project, swept it, reported, cut a car and posed as one"

#!/bin/sh
# The commands of the first tutorial with an installed foldcar, in a new folder. Writes the runs to TABLE, which is the same
# on every system.
#
# Usage: first_study.sh FOLDCAR TABLE
set -eu
foldcar=$1
table=$(cd "$(dirname "$2")" && pwd)/$(basename "$2")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"$foldcar" new yard
cd yard
"$foldcar" sample yard.scenic -n 3 --plot yard.png
"$foldcar" sweep study.json --store study.db
"$foldcar" report study.db -o report
"$foldcar" select study.db
"$foldcar" export study.db --csv "$table"

#!/bin/sh
# Runs `make study` and `make test` as a new user would: in a bare Debian or Ubuntu, in a clone of this repository's HEAD.
#
# Usage, as root: fresh.sh SUITE [TARGET...]     e.g. fresh.sh trixie study; WHEEL=dist/….whl fresh.sh trixie installed
#
# tools/bare_root.sh makes the root anew at each call, in .fresh/SUITE. All runs in a mount and process namespace of its
# own: however it ends, nothing stays mounted or running. The root and the logs stay for a look.
set -eu

fail() {
  echo "fresh: $*" >&2
  exit 2
}

suite=${1:-}
case $suite in
'' | *[!a-z]*) fail 'name a suite of Debian or Ubuntu: fresh.sh SUITE [TARGET...]' ;;
esac
[ "$(id -u)" = 0 ] || fail 'debootstrap and chroot need root'
if [ "${FRESH_INSIDE:-}" != yes ]; then
  exec env FRESH_INSIDE=yes unshare --mount --propagation private --pid --fork --kill-child "$0" "$@"
fi
# The first process of a namespace ends at a signal only if it says so.
trap 'exit 130' INT
trap 'exit 143' TERM HUP
shift
[ $# -gt 0 ] || set -- study test

project=$(cd "$(dirname "$0")/.." && pwd)
root=$project/.fresh/$suite
"$project/tools/bare_root.sh" "$suite" "$root" git,make
git clone --quiet "$project" "$root/root/foldcar"
# For the target `installed`: a wheel that was built elsewhere.
if [ -n "${WHEEL:-}" ]; then
  mkdir "$root/root/foldcar/dist"
  cp "$WHEEL" "$root/root/foldcar/dist"
fi

for target in "$@"; do
  began=$(date +%s)
  status=0
  # As after a log-in: none of the caller's variables but those of the network, and no terminal.
  xargs -0 -a "$root.env" sh -c 'root=$1 target=$2; shift 2; exec chroot "$root" env -i \
    HOME=/root PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin "$@" make -C /root/foldcar "$target"' \
    sh "$root" "$target" || status=$?
  echo "fresh: $suite: make $target: $([ $status = 0 ] && echo passed || echo FAILED) in $(($(date +%s) - began)) s"
  [ $status = 0 ] || exit 1
done

#!/bin/sh
# Runs `make study` and `make test` as a new user would: in a bare Debian or Ubuntu, in a clone of this repository's HEAD.
#
# Usage, as root: fresh.sh SUITE [TARGET...]     e.g. fresh.sh trixie study; WHEEL=dist/….whl fresh.sh trixie installed
#
# debootstrap makes the root anew at each call, in .fresh/SUITE, from the mirror that this machine's apt names.
# For Ubuntu's suites name one: MIRROR=http://... COMPONENTS=main,universe. This machine's proxies, certificates and
# settings of apt and pip hold inside too. All runs in a mount and process namespace of its own: however it ends,
# nothing stays mounted or running. The root and the logs stay for a look.
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
mirror=${MIRROR:-$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' 'Component: main' | head -n 1)}
[ -n "$mirror" ] || fail 'apt names no mirror; name one: MIRROR=...'

echo "fresh: a bare $suite in $root"
rm -rf "$root"
mkdir -p "$root"
debootstrap --variant=minbase --components="${COMPONENTS:-main}" --include=ca-certificates,git,make \
  "$suite" "$root" "$mirror" >"$root.debootstrap.log" 2>&1 ||
  fail "debootstrap: $(tail -n 1 "$root.debootstrap.log") ($root.debootstrap.log)"

for file in /etc/resolv.conf /etc/hosts /etc/pip.conf "$HOME/.config/pip/pip.conf" /etc/ssl/certs/ca-certificates.crt \
  "${PIP_CERT:-}" "${SSL_CERT_FILE:-}" "${REQUESTS_CA_BUNDLE:-}"; do
  [ -f "$file" ] || continue
  mkdir -p "$root$(dirname "$file")"
  cp --dereference "$file" "$root$file"
done
apt-config dump Acquire --format '%F "%v";%n' | grep -iE '^Acquire::(https?|Check-[a-z-]+|Retries)[: ]' \
  >"$root/etc/apt/apt.conf.d/90network" || true
variables='https?_proxy|no_proxy|ssl_cert_file|requests_ca_bundle|pip_(cert|default_timeout|(extra_)?index_url|trusted_host)'
env --null | grep -ziE "^($variables)=" >"$root.env" || true

mount -t proc proc "$root/proc"
mount --rbind /dev "$root/dev"
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

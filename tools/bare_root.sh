#!/bin/sh
# Makes a bare Debian or Ubuntu in the folder ROOT, by debootstrap, from the mirror that this machine's apt names.
#
# Usage, as root, in a mount namespace of one's own: bare_root.sh SUITE ROOT [PACKAGE,...]
#
# For Ubuntu's suites name a mirror: MIRROR=http://... COMPONENTS=main,universe. This machine's proxies, certificates and
# settings of apt, pip and npm hold inside too; the variables among them are in ROOT.env, each ended by a zero byte.
set -eu

fail() {
  echo "bare_root: $*" >&2
  exit 2
}

suite=$1
root=$2
[ "$(id -u)" = 0 ] || fail 'debootstrap and chroot need root'
mirror=${MIRROR:-$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' 'Component: main' | head -n 1)}
[ -n "$mirror" ] || fail 'apt names no mirror; name one: MIRROR=...'

echo "a bare $suite in $root"
rm -rf "$root"
mkdir -p "$root"
debootstrap --variant=minbase --components="${COMPONENTS:-main}" --include="ca-certificates${3:+,$3}" \
  "$suite" "$root" "$mirror" >"$root.debootstrap.log" 2>&1 ||
  fail "debootstrap: $(tail -n 1 "$root.debootstrap.log") ($root.debootstrap.log)"

for file in /etc/resolv.conf /etc/hosts /etc/pip.conf "$HOME/.config/pip/pip.conf" "$HOME/.npmrc" \
  /etc/ssl/certs/ca-certificates.crt \
  "${PIP_CERT:-}" "${SSL_CERT_FILE:-}" "${REQUESTS_CA_BUNDLE:-}"; do
  [ -f "$file" ] || continue
  mkdir -p "$root$(dirname "$file")"
  cp --dereference "$file" "$root$file"
done
apt-config dump Acquire --format '%F "%v";%n' | grep -iE '^Acquire::(https?|Check-[a-z-]+|Retries)[: ]' \
  >"$root/etc/apt/apt.conf.d/90network" || true
variables='https?_proxy|no_proxy|ssl_cert_file|requests_ca_bundle|node_extra_ca_certs|pip_(cert|default_timeout|(extra_)?index_url|trusted_host)'
env --null | grep -ziE "^($variables)=" >"$root.env" || true

mount -t proc proc "$root/proc"
mount --rbind /dev "$root/dev"

#!/bin/sh
# Installs the system packages that foldcar is built from, or runs with, on Debian 12 and later and on Ubuntu 22.04 and later.
# Does nothing, quickly, if they are there. Without root and without sudo it names what is missing and exits with 2.
#
# Usage: install_system_packages.sh [wasm | tests | check | fresh | run]
# Besides, what only carsim.wasm, only the tests, only `make check` and `make fuzz`, or only tools/fresh.sh need; run: only what a foldcar
# installed from a wheel needs
set -eu

# Compiler and build tools; the JSON library, which the simulator is built with; Python and its venv module;
# git, with which PlatformIO fetches libraries; what Scenic's image library (OpenCV) loads.
packages='g++ make python3 python3-venv ca-certificates git nlohmann-json3-dev libgl1 libglib2.0-0 libxcb1'
case ${1:-} in
'') ;;
# The compiler to WebAssembly.
wasm) packages='emscripten' ;;
# ccache compiles once what several environments compile alike; Chromium is the browser in which tests open pages: Ubuntu
# has no such package, only a snap that reads no temporary files.
tests)
  packages="$packages ccache"
  command -v google-chrome >/dev/null || grep -q '^ID=ubuntu$' /etc/os-release || packages="$packages chromium"
  ;;
check)
  # The sanitizers' run-time library has a package of its own from Clang 14 of Debian on.
  if ! command -v clang++-19 >/dev/null || ! command -v clang-tidy-19 >/dev/null; then
    packages="$packages clang clang-tidy"
    version=$(apt-cache depends clang | sed -n 's/^ *Depends: clang-\([0-9]*\)$/\1/p')
    runtime="libclang-rt-$version-dev"
    apt-cache show "$runtime" >/dev/null 2>&1 && packages="$packages $runtime"
  fi
  ;;
fresh) packages="$packages debootstrap" ;;
run) packages='python3 python3-venv ca-certificates libgl1 libglib2.0-0 libxcb1' ;;
*) echo "install_system_packages: unknown purpose $1; it is wasm, tests, check, fresh or run" >&2 && exit 2 ;;
esac

if ! command -v apt-get >/dev/null || ! command -v dpkg-query >/dev/null; then
  echo "install_system_packages: this is no Debian or Ubuntu; install what answers to: $packages" >&2
  exit 2
fi

# A package also counts if another one provides it: newer releases have libglib2.0-0t64 for libglib2.0-0.
installed=$(dpkg-query -W -f '${db:Status-Status} ${Package}, ${Provides}\n' | sed -n 's/^installed //p' |
  sed 's/([^)]*)//g; s/:[a-z0-9]*//g' | tr -d ' ' | tr ',' '\n')
missing=''
for package in $packages; do
  printf '%s\n' "$installed" | grep -qxF "$package" || missing="$missing $package"
done
[ -n "$missing" ] || exit 0

if [ "$(id -u)" = 0 ]; then
  as_root='env'
elif command -v sudo >/dev/null && { sudo -n true 2>/dev/null || [ -t 0 ]; }; then
  as_root='sudo'
else
  echo "install_system_packages: as root, install these packages first: apt-get install$missing" >&2
  exit 2
fi
echo "Installing system packages:$missing"
$as_root apt-get update -q
# shellcheck disable=SC2086  # a list of names
exec $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends $missing

#!/bin/sh
# sh samples/packages.sh [build|test]: installs by apt what effuse needs and this machine lacks; says nothing and asks
# for nothing when all is there. build: to build and run effuse. test: that, and what its tests take.
# The one list of packages: quickstart.sh and tests/run.sh call this.
set -eu

build_packages="
  g++ cmake ninja-build ccache git
  libcgal-dev libeigen3-dev libassimp-dev libgdal-dev libopenvdb-dev libboost-iostreams-dev libtbb-dev libfcl-dev libembree-dev
  libcli11-dev libtomlplusplus-dev libfmt-dev nlohmann-json3-dev libpng-dev libopenexr-dev zlib1g-dev libcairo2-dev"
test_packages="
  libgtest-dev libgmock-dev libbenchmark-dev libbullet-dev debootstrap dpkg-dev assimp-utils libopenvdb-tools chromium ca-certificates
  blender paraview python3-paraview python3-numpy xvfb libgl1-mesa-dri"

case "${1:-build}" in
  build) wanted=$build_packages ;;
  test)
    wanted="$build_packages $test_packages"
    # Debian's node clashes with one from elsewhere: only where there is none.
    command -v node > /dev/null || wanted="$wanted nodejs"
    command -v npm > /dev/null || wanted="$wanted npm"
    ;;
  *)
    echo "usage: sh samples/packages.sh [build|test]" >&2
    exit 2
    ;;
esac

if ! command -v apt-get > /dev/null || ! command -v dpkg-query > /dev/null; then
  echo "effuse installs its packages by apt, from Debian 12 or a system made of it, and finds no apt here." >&2
  echo "Install these yourself, under the names your system has for them, and build with: cmake --preset release && cmake --build --preset release" >&2
  echo $wanted >&2
  exit 2
fi

missing=""
for package in $wanted; do
  [ "$(dpkg-query -W -f '${db:Status-Status}' "$package" 2> /dev/null)" = installed ] || missing="$missing $package"
done
[ -n "$missing" ] || exit 0

as_root=""
if [ "$(id -u)" -ne 0 ]; then
  if ! command -v sudo > /dev/null; then
    echo "These packages are missing, and neither root nor sudo is here to install them:" >&2
    echo "  apt-get install --no-install-recommends$missing" >&2
    exit 2
  fi
  as_root="sudo"
fi
apt() { $as_root env DEBIAN_FRONTEND=noninteractive apt-get -q -o DPkg::Lock::Timeout=300 -o Dpkg::Use-Pty=0 "$@"; }

echo "installing:$missing"
log=$(mktemp)
if ! { apt update && apt install -y --no-install-recommends $missing; } > "$log" 2>&1; then
  tail -20 "$log" >&2
  rm -f "$log"
  echo "apt could not install them (above: its last words)." >&2
  exit 1
fi
rm -f "$log"

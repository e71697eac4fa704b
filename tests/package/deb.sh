#!/bin/sh
# sh deb.sh BUILD WORK: makes the .deb, installs it with what it depends on into a bare Debian of its own, and runs it there.
# Skipped (77), with the reason, where a bare Debian cannot be made: without root, debootstrap, or packages to download.
set -eu
build=$1
work=$2
rm -rf "$work"
mkdir -p "$work/made"
skip() {
  echo "skipped: $1"
  exit 77
}

(cd "$build" && cpack -G DEB -B "$work/made" > "$work/cpack.log" 2>&1) || { cat "$work/cpack.log"; exit 1; }
deb=$(ls "$work"/made/*.deb)
dpkg-deb -c "$deb" > "$work/list"
for file in ./usr/bin/effuse ./usr/share/man/man1/effuse.1.gz ./usr/share/bash-completion/completions/effuse ./usr/lib/cmake/effuse/effuse-config.cmake ./usr/share/effuse/scenes/maunga-whau.toml; do
  grep -q " $file\$" "$work/list" || { echo "the package lacks $file"; exit 1; }
done
mkdir "$work/unpacked"
dpkg-deb -x "$deb" "$work/unpacked"  # for those who link it

[ "$(id -u)" = 0 ] || skip "only root can make a bare Debian"
command -v debootstrap > /dev/null || skip "debootstrap is not installed"
release=$(. /etc/os-release && echo "$VERSION_CODENAME")
# From where this machine has its own packages.
mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' | head -1)
root=$work/root
debootstrap --variant=minbase "$release" "$root" "$mirror" > "$work/debootstrap.log" 2>&1 || { tail -3 "$work/debootstrap.log"; skip "no bare Debian could be made"; }
cp /etc/resolv.conf "$root/etc/" 2> /dev/null || true
cp "$deb" "$root/tmp/effuse.deb"
in_root() { chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root DEBIAN_FRONTEND=noninteractive ${http_proxy:+http_proxy=$http_proxy} ${https_proxy:+https_proxy=$https_proxy} "$@"; }
in_root apt-get -q update > "$work/apt.log" 2>&1 || { tail -3 "$work/apt.log"; skip "no packages to download"; }
in_root apt-get -q install -y --no-install-recommends /tmp/effuse.deb > "$work/apt.log" 2>&1 || { tail -20 "$work/apt.log"; exit 1; }

in_root effuse --version
in_root effuse run /usr/share/effuse/scenes/lava.toml -o /tmp/run --frames 6 --quiet
[ -s "$root/tmp/run/frames/skin.0006.ply" ] && [ -s "$root/tmp/run/preview/preview.0006.png" ] || { echo "the run left no frames"; exit 1; }
in_root apt-get -q remove -y effuse > /dev/null 2>&1
[ ! -e "$root/usr/bin/effuse" ] || { echo "removed, and still there"; exit 1; }
rm -rf "$root"

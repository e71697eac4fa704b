#!/bin/sh
# sh samples/quickstart.sh [arguments of effuse run]: from a fresh clone to lava on a mountain. Installs the packages
# that are missing, builds the program, runs Maunga Whau, and says where the frames and pictures are.
set -eu
cd "$(dirname "$0")/.."
scene=samples/scenes/maunga-whau.toml
out=out/maunga-whau

# Ctrl-C ends with a word instead of make's and apt's; nothing that was done is lost.
doing="installing packages"
exec 3>&2  # what comes under way may write to a log
stopped() {
  trap - INT TERM
  echo >&3
  echo "stopped while $doing; $again" >&3
  exit 130
}
again="sh samples/quickstart.sh goes on from there"
trap stopped INT TERM

sh samples/packages.sh build

# A build folder that is there keeps its settings; a new one leaves the tests out and what they would need.
fresh=""
[ -f build/release/CMakeCache.txt ] || fresh="-DEFFUSE_TESTS=OFF -DEFFUSE_BENCHMARKS=OFF"
jobs=$(sh samples/jobs.sh)
# Twenty minutes of compilers in all, on Xeon cores; ccache makes it seconds once it was built.
echo "$(date +%H:%M) building effuse, $jobs compilers at once: about $((20 / jobs + 1)) minutes the first time where the cores are free; what it says goes to build/quickstart.log"
doing="building"
began=$(date +%s)
mkdir -p build
log=build/quickstart.log
if ! { cmake --preset release $fresh && cmake --build --preset release --target effuse -j "$jobs"; } > "$log" 2>&1; then
  tail -30 "$log" >&2
  echo "the build failed; all it said is in $log" >&2
  exit 1
fi
took=$(($(date +%s) - began))
echo "$(date +%H:%M) built in $((took / 60)) min $((took % 60)) s"
effuse=build/release/samples/effuse

# Called again, it goes on where it was, or says at once that all is made.
if [ $# -eq 0 ] && [ -f "$out/scene.toml" ]; then
  set -- --resume
fi
doing="running"
[ $# -eq 0 ] || [ "$*" = --resume ] || again="the line above goes on with it, from $PWD"
echo "running $effuse run $scene -o $out $*"
"$effuse" run "$scene" -o "$out" "$@"

echo
echo "frames:    $PWD/$out/frames ($(find "$out/frames" -type f | wc -l) files, $(du -sh "$out/frames" | cut -f 1))"
echo "pictures:  $PWD/$out/preview ($(find "$out/preview" -name 'preview.*.png' | wc -l) of them)"
echo "at once:   $PWD/$out/preview/contact_sheet.png"
echo "program:   $PWD/$effuse"
echo "next:      export PATH=\"$PWD/build/release/samples:\$PATH\"  # then your own mountain: samples/tutorial.md"

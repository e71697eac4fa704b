#!/bin/sh
# sh samples/quickstart.sh [arguments of effuse run]: from a fresh clone to lava on a mountain. Installs the packages
# that are missing, builds the program, runs Maunga Whau, and says where the frames and pictures are.
set -eu
cd "$(dirname "$0")/.."
scene=samples/scenes/maunga-whau.toml
out=out/maunga-whau

sh samples/packages.sh build

# A build folder that is there keeps its settings; a new one leaves the tests out and what they would need.
fresh=""
[ -f build/release/CMakeCache.txt ] || fresh="-DEFFUSE_TESTS=OFF -DEFFUSE_BENCHMARKS=OFF"
echo "building effuse (some minutes the first time)"
mkdir -p build
log=build/quickstart.log
if ! { cmake --preset release $fresh && cmake --build --preset release --target effuse -j "$(sh samples/jobs.sh)"; } > "$log" 2>&1; then
  tail -30 "$log" >&2
  echo "the build failed; all it said is in $log" >&2
  exit 1
fi
effuse=build/release/samples/effuse

# Called again, it goes on where it was, or says at once that all is made.
if [ $# -eq 0 ] && [ -f "$out/scene.toml" ]; then
  set -- --resume
fi
echo "running $effuse run $scene -o $out $*"
"$effuse" run "$scene" -o "$out" "$@"

echo
echo "frames:    $PWD/$out/frames ($(find "$out/frames" -type f | wc -l) files, $(du -sh "$out/frames" | cut -f 1))"
echo "pictures:  $PWD/$out/preview ($(find "$out/preview" -name 'preview.*.png' | wc -l) of them)"
echo "at once:   $PWD/$out/preview/contact_sheet.png"
echo "program:   $PWD/$effuse"

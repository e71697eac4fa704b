#!/bin/sh
# sh samples/gallery.sh [SCENE...]: runs the scenes of samples/scenes (all, or those named) as they stand, one after the other, and writes
# samples/gallery.md: of each its first comment, its picture, what it took. A scene that has no picture yet gets one, of its last frame
# (needs ffmpeg). Lines of scenes that were not run stay. Half an hour for all, and some ten gigabytes under out/gallery.
set -eu
cd "$(dirname "$0")/.."
effuse=build/release/samples/effuse
[ -x "$effuse" ] || { echo "build first: sh samples/quickstart.sh, or cmake --preset release && cmake --build --preset release" >&2; exit 2; }
page=samples/gallery.md
rows=$(mktemp)
trap 'rm -f "$rows"' EXIT
[ $# -gt 0 ] || set -- $(cd samples/scenes && ls ./*.toml | sed 's|^\./||; s|\.toml$||')

for name in "$@"; do
  scene=samples/scenes/$name.toml
  out=out/gallery/$name
  echo "$name"
  "$effuse" run "$scene" -o "$out" --force --quiet --json --set 'output.formats=["ply"]' > "$out.json" || { echo "$name failed" >&2; exit 1; }
  seconds=$(sed -n 's/^ "seconds": \([0-9.]*\).*/\1/p' "$out.json" | head -1)
  megabytes=$(sed -n 's/^ "peak_memory_bytes": \([0-9]*\)[0-9]\{6\}.*/\1/p' "$out.json" | head -1)
  frames=$(sed -n 's/^ "frames": \([0-9]*\).*/\1/p' "$out/manifest.json" | head -1)
  picture=samples/scenes/$name.jpg
  [ -e "$picture" ] || ffmpeg -v error -y -i "$out/preview/preview.$(printf %04d "$frames").png" -q:v 5 "$picture"
  about=$(sed -n '1s/^# //p' "$scene")
  [ -n "$about" ] || about=$(sed -n 's/^name = "\(.*\)"/\1/p' "$scene" | head -1)
  printf '| [%s](scenes/%s.toml) | ![%s](scenes/%s.jpg) | %s | %s frames, %.0f s, %s MB |\n' "$name" "$name" "$name" "$name" "$about" "$frames" "$seconds" "$megabytes" >> "$rows"
done

# What was not run keeps its line.
if [ -e "$page" ]; then
  grep '^| \[' "$page" | while IFS= read -r line; do
    name=${line#| [}
    name=${name%%]*}
    grep -q "^| \[$name\]" "$rows" || printf '%s\n' "$line" >> "$rows"
  done
fi
{
  echo "# Gallery"
  echo
  echo "One small scene for each effect and feature, as \`sh samples/gallery.sh\` ran them on two cores, with meshes as PLY and a picture of each frame. \`effuse run samples/scenes/NAME.toml\` makes any of them again."
  echo
  echo "| scene | picture | what it shows | took |"
  echo "|---|---|---|---|"
  sort "$rows"
} > "$page"

#!/bin/sh
# sh samples/gallery.sh [SCENE...]: runs the scenes of samples/scenes (all, or those named) as they stand, one after the other, and writes
# samples/gallery.md: of each the first sentence of its comment, its picture, what it took. Simulated and meshed alone, without a picture
# a frame: times are of the processor, which a busy machine does not lengthen. A scene that has no picture yet gets one, of the frame that
# its line "# gallery: frame 90" names or else its last (needs ffmpeg); "# gallery: none" leaves a scene out. Lines of scenes that were not run stay. Frames go to out/gallery
# and are removed when their scene is done.
set -eu
cd "$(dirname "$0")/.."
effuse=${EFFUSE:-build/release/samples/effuse}
[ -x "$effuse" ] || { echo "build first: sh samples/quickstart.sh, or cmake --preset release && cmake --build --preset release" >&2; exit 2; }
page=samples/gallery.md
rows=$(mktemp)
trap 'rm -f "$rows"' EXIT
[ $# -gt 0 ] || set -- $(cd samples/scenes && ls ./*.toml | sed 's|^\./||; s|\.toml$||')

# The comment that a scene's file begins with, as one line, up to its first full stop; without one its name.
about_of() {
  comment=$(sed -n '/^# gallery:/d; /^#/!q; s/^# //p' "$1" | tr '\n' ' ' | sed 's/\. .*/./; s/ *$//')
  [ -n "$comment" ] || comment=$(sed -n 's/^name = "\(.*\)"/\1/p' "$1" | head -1)
  echo "$comment"
}

mkdir -p out/gallery
for name in "$@"; do
  scene=samples/scenes/$name.toml
  out=out/gallery/$name
  if grep -q '^# gallery: none' "$scene"; then continue; fi
  echo "$name"
  "$effuse" run "$scene" -o "$out" --force --quiet --json --set 'output.formats=["ply"]' --set preview.pictures=false > "$out.json" || { echo "$name failed" >&2; exit 1; }
  seconds=$(sed -n 's/^ "processor_seconds": \([0-9.e+-]*\).*/\1/p' "$out.json" | head -1)
  seconds=$(awk -v s="$seconds" 'BEGIN { printf(s < 9.95 ? "%.1f" : "%.0f", s) }')
  megabytes=$(sed -n 's/^ "peak_memory_bytes": \([0-9]*\)[0-9]\{6\}.*/\1/p' "$out.json" | head -1)
  frames=$(sed -n 's/^ "frames": \([0-9]*\).*/\1/p' "$out/manifest.json" | head -1)
  picture=samples/scenes/$name.jpg
  if [ ! -e "$picture" ]; then
    shown=$(sed -n 's/^# gallery: frame \([0-9]*\).*/\1/p' "$scene")
    shown=${shown:-$frames}
    "$effuse" render "$out" --frames "$shown" --quiet --force --set preview.samples=16
    ffmpeg -v error -y -i "$out/render/render.$(printf %04d "$shown").png" -q:v 3 "$picture"
  fi
  rm -r "$out"
  about=$(about_of "$scene")
  printf '| [%s](scenes/%s.toml) | ![%s](scenes/%s.jpg) | %s | %s frames, %s s, %s MB |\n' "$name" "$name" "$name" "$name" "$about" "$frames" "$seconds" "$megabytes" >> "$rows"
done

# What was not run keeps its line.
if [ -e "$page" ]; then
  grep '^| \[' "$page" | while IFS= read -r line; do
    name=${line#| [}
    name=${name%%]*}
    grep -q "^| \[$name\]" "$rows" || printf '%s\n' "$line" >> "$rows"
  done
fi
# Those with a picture that were never run have a line, too.
for picture in samples/scenes/*.jpg; do
  name=$(basename "$picture" .jpg)
  scene=samples/scenes/$name.toml
  [ -e "$scene" ] || continue
  grep -q "^| \[$name\]" "$rows" || printf '| [%s](scenes/%s.toml) | ![%s](scenes/%s.jpg) | %s | not timed |\n' "$name" "$name" "$name" "$name" "$(about_of "$scene")" >> "$rows"
done
{
  echo "# Gallery"
  echo
  echo "One small scene for each effect and feature, as \`sh samples/gallery.sh\` ran them on two cores, with meshes as PLY and no pictures: seconds of processor time, and the most memory. \`effuse run samples/scenes/NAME.toml\` makes any of them again."
  echo
  echo "| scene | picture | what it shows | took |"
  echo "|---|---|---|---|"
  sort "$rows"
} > "$page"
